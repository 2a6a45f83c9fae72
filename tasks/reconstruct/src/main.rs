//! Single-view 3D reconstruction: a network that learns shapes from their silhouettes.

/// Images are allocated by the thousand, each too large for the system's allocator to reuse.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    softrast_lab::program::run_main(reconstruct::execute)
}
