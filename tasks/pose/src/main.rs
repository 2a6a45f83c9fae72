//! POSE: finds the pose of a camera from a silhouette.

fn main() -> std::process::ExitCode {
    pose::main()
}
