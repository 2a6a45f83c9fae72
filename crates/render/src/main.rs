//! Draws soft silhouettes of a mesh and measures what they cost.

fn main() -> std::process::ExitCode {
    softrast_lab::program::run_main(render::execute)
}
