//! Times of whole steps on a GPU and on the CPU.
//!
//! ```text
//! cargo bench -p softrast-raster --no-default-features --features wgpu --bench gpu              # a table
//! cargo bench -p softrast-raster --no-default-features --features wgpu --bench gpu -- --json    # and a line of JSON
//! cargo bench -p softrast-raster --no-default-features --features wgpu --bench gpu -- W1        # those with W1 in their names
//! cargo bench -p softrast-raster --no-default-features --features cuda --bench gpu              # through CUDA
//! ```
//!
//! A step is an iteration of an optimisation except its update: projection, image, mean squared difference to a disk (of colours to black),
//! gradient with respect to the world vertices. Steps are queued as in a run without output: the CPU seldom waits for the GPU.

mod machine;
#[allow(dead_code, reason = "other benchmarks measure more of a workload")]
mod workload;

use std::time::{Duration, Instant};

use machine::machine;
use softrast_raster::{Attributes, ColourRenderer, RasterBackend, SoftRenderer, mse_loss, project};
#[cfg(feature = "cuda")]
use softrast_raster::{Cuda as Gpu, cuda_device_name as device_name};
#[cfg(not(feature = "cuda"))]
use softrast_raster::{Wgpu as Gpu, adapter_name as device_name};
use softrast_softness::Family;
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};
use workload::{SOFTNESS, Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Each measurement runs unrecorded once, then as batches of steps of `BATCH` together until `MEASUREMENT` is over.
const MEASUREMENT: Duration = Duration::from_millis(1500);
const BATCH: Duration = Duration::from_millis(50);

fn main() {
    match device_name() {
        Ok(name) => println!("GPU: {name}; CPU: {}", machine()),
        Err(none) => {
            println!("skipped: {none}");
            return;
        }
    }
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let filter = words.iter().find(|word| !word.starts_with("--"));
    let wanted = |workload: &Workload| filter.is_none_or(|part| workload.name.contains(part));
    let silhouettes = [Workload::w1(), Workload::w2(), Workload::w4(), Workload::w5()];
    let colours = Workload { name: "W3 (W2 in colours)".to_owned(), ..Workload::w2() };
    println!("{:<56} {:>10} {:>10}", "a step, ms (median)", "GPU", "CPU");
    let mut rows = Vec::new();
    for workload in silhouettes.iter().filter(|workload| wanted(workload)) {
        let gpu = median(|| silhouette::<Gpu>(workload));
        let cpu = median(|| silhouette::<NdArray<f32>>(workload));
        rows.push(shown(&workload.name, [gpu, cpu]));
    }
    if wanted(&colours) {
        let gpu = median(|| coloured::<Gpu>(&colours));
        let cpu = median(|| coloured::<NdArray<f32>>(&colours));
        rows.push(shown(&colours.name, [gpu, cpu]));
    }
    if words.iter().any(|word| word == "--json") {
        println!("[{}]", rows.join(","));
    }
}

/// Prints a row of the table, and returns it as JSON.
fn shown(name: &str, [gpu, cpu]: [f64; 2]) -> String {
    println!("{name:<56} {gpu:>10.3} {cpu:>10.3}");
    format!("{{\"workload\":\"{name}\",\"gpu_ms\":{gpu},\"cpu_ms\":{cpu}}}")
}

/// A step that can be repeated: it returns the gradient without waiting for it.
type Step<T> = Box<dyn Fn() -> Tensor<T, 3>>;

fn silhouette<T: RasterBackend>(workload: &Workload) -> Step<T> {
    let Workload { size, width, .. } = *workload;
    let renderer = SoftRenderer::new(&workload.faces, size, SOFTNESS, width * width);
    let world: Tensor<T, 3> = workload.world(DType::F32);
    let cameras = workload.cameras::<Autodiff<T>>(DType::F32);
    let target = tensor::<Autodiff<T>, 3>(&disk(size), [1, size, size], DType::F32);
    Box::new(move || {
        let world = Tensor::from_inner(world.clone()).require_grad();
        let seen = project(world.clone(), cameras.clone());
        world.grad(&renderer.mse_loss(seen, target.clone()).backward()).expect("a gradient")
    })
}

fn coloured<T: RasterBackend>(workload: &Workload) -> Step<T> {
    let size = workload.size;
    let renderer = ColourRenderer::new(&workload.faces, size, Family::Exp, 0.01, [1.7, 3.8]);
    let world: Tensor<T, 3> = workload.world(DType::F32);
    let cameras = workload.cameras::<Autodiff<T>>(DType::F32);
    let colours = world.clone() * 0.5 + 0.5;
    let faces = workload.faces.clone();
    let black =
        tensor::<Autodiff<T>, 4>(&vec![0.0; 4 * size * size], [1, 4, size, size], DType::F32);
    let background = renderer.background(&[0.0; 3], &Default::default());
    Box::new(move || {
        let world = Tensor::from_inner(world.clone()).require_grad();
        let attributes = Attributes::of_vertices(Tensor::from_inner(colours.clone()), &faces);
        let image =
            renderer.image(project(world.clone(), cameras.clone()), &attributes, &background);
        world.grad(&mse_loss(image, black.clone()).backward()).expect("a gradient")
    })
}

/// Median time of a step in milliseconds.
fn median<T: RasterBackend>(step: impl Fn() -> Step<T>) -> f64 {
    let step = step();
    let timed = |steps: u32| {
        let start = Instant::now();
        let gradients: Vec<_> = (0..steps).map(|_| step()).collect();
        // The last gradient is ready after all others.
        let last = gradients.into_iter().next_back().expect("a step");
        let _ = last.narrow(1, 0, 1).into_data();
        start.elapsed()
    };
    timed(1);
    let once = timed(1);
    let steps = (BATCH.as_secs_f64() / once.as_secs_f64()).ceil().clamp(1.0, 100.0) as u32;
    let (mut samples, start) = (Vec::new(), Instant::now());
    while samples.len() < 3 || start.elapsed() < MEASUREMENT {
        samples.push(timed(steps).as_secs_f64() * 1e3 / f64::from(steps));
    }
    samples.sort_by(f64::total_cmp);
    samples[samples.len() / 2]
}
