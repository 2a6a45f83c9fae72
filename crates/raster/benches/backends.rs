//! Times of a silhouette step on `Flex` and on `NdArray`, measured alternately so that both see the same load.
//!
//! ```text
//! cargo bench -p softrast-raster --bench backends --features flex
//! ```
//!
//! A step is an iteration of an optimisation: projection, image, loss, gradient with respect to the world vertices, in f32. Prints medians,
//! and the median of the ratios of adjacent steps.

#[allow(dead_code, reason = "the other benchmark uses the rest")]
mod workload;

use std::time::Instant;

use softrast_raster::{RasterBackend, iou_loss, low_level::Rasterizer, project};
use softrast_tensor::{Autodiff, DType, Flex, NdArray, Tensor};
use workload::{Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Steps on each backend.
const STEPS: usize = 301;

fn main() {
    println!("| workload | Flex, ms | NdArray, ms | ratio |\n|---|--:|--:|--:|");
    for workload in [Workload::w1(), Workload::w2()] {
        let (flex, ndarray) = (step::<Flex>(&workload), step::<NdArray<f32>>(&workload));
        let pairs: Vec<[f64; 2]> = (0..STEPS).map(|_| [flex(), ndarray()]).collect();
        let [flex, ndarray] = [0, 1].map(|k| median(pairs.iter().map(|pair| pair[k])));
        let ratio = median(pairs.iter().map(|[flex, ndarray]| flex / ndarray));
        println!("| {} | {flex:.2} | {ndarray:.2} | {ratio:.2} |", workload.name);
    }
}

/// A step that returns its time in milliseconds.
fn step<B: RasterBackend>(workload: &Workload) -> impl Fn() -> f64 {
    let size = workload.size;
    let (silhouette, table) = workload.prepare::<B>(Rasterizer::TOLERANCE, DType::F32);
    let (world, cameras) = (workload.world::<B>(DType::F32), workload.cameras::<B>(DType::F32));
    let target: Tensor<B, 3> = tensor(&disk(size), [1, size, size], DType::F32);
    move || {
        let clock = Instant::now();
        let world = Tensor::<Autodiff<B>, 3>::from_inner(world.clone()).require_grad();
        let vertices = project(world.clone(), Tensor::from_inner(cameras.clone())).tensor();
        let image = silhouette.coverage_by_table(vertices, Tensor::from_inner(table.clone()));
        let loss = iou_loss(image, Tensor::from_inner(target.clone()));
        world.grad(&loss.mean().backward()).expect("the loss depends on the vertices");
        clock.elapsed().as_secs_f64() * 1e3
    }
}

fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
