//! Draws soft silhouettes of a mesh and measures what they cost.

fn main() -> std::process::ExitCode {
    render::main()
}
