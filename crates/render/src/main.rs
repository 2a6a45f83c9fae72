//! Draws soft silhouettes or colours of a mesh and measures what they cost.

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    softrast_lab::program::run_main(render::execute)
}
