//! Tests every softness on scenes where rasterizers and optimisers fail.

fn main() -> std::process::ExitCode {
    softrast_lab::program::run_main(stability::execute)
}
