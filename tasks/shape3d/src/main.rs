//! 3D SHAPE: deforms a sphere until it has the silhouettes of a target.

fn main() -> std::process::ExitCode {
    shape3d::main()
}
