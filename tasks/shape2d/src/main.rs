//! 2D SHAPE: moves loose triangles until they cover a picture.

fn main() -> std::process::ExitCode {
    softrast_cli::main::<shape2d::Shape2d>()
}
