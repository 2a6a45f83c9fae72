//! 2D SHAPE: moves loose triangles until they cover a picture.

fn main() -> std::process::ExitCode {
    shape2d::main()
}
