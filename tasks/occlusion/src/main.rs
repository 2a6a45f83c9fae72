//! OCCLUSION: finds which of several overlapping quads is in front.

fn main() -> std::process::ExitCode {
    occlusion::main()
}
