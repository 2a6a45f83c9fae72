//! 3D SHAPE: deforms a sphere until it has the silhouettes of a target.

fn main() -> std::process::ExitCode {
    softrast_cli::main::<shape3d::Shape3d>()
}
