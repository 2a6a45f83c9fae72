//! Tests every softness on scenes where rasterizers and optimisers fail.

fn main() -> std::process::ExitCode {
    stability::main()
}
