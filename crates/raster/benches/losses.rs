//! Times of a step with the fused loss of silhouettes and of one with a separate loss, measured alternately under the same load.
//!
//! ```text
//! cargo bench -p softrast-raster --bench losses
//! ```
//!
//! A step is an iteration of an optimisation: projection, image, loss, gradient with respect to the world vertices, in f32. Prints medians,
//! and the median of the ratios of adjacent steps.

#[allow(dead_code, reason = "the other benchmark uses the rest")]
mod workload;

use std::time::Instant;

use softrast_raster::{
    iou_loss,
    low_level::{PixelLoss, Rasterizer},
    mse_loss, project,
};
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};
use workload::{Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

type B = NdArray<f32>;
type A = Autodiff<B>;

/// Steps of each kind.
const STEPS: usize = 301;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "| workload | loss | threads | one op, ms | two ops, ms | ratio |\n|---|---|--:|--:|--:|--:|"
    );
    for (name, workload) in [("W1", Workload::w1()), ("W2", Workload::w2())] {
        let size = workload.size;
        let (silhouette, table) = workload.prepare::<B>(Rasterizer::TOLERANCE, DType::F32);
        let (world, cameras) = (workload.world::<B>(DType::F32), workload.cameras::<B>(DType::F32));
        let target: Tensor<B, 3> = tensor(&disk(size), [1, size, size], DType::F32);
        let step = |iou: bool, together: bool| {
            let clock = Instant::now();
            let world = Tensor::<A, 3>::from_inner(world.clone()).require_grad();
            let vertices = project(world.clone(), Tensor::from_inner(cameras.clone())).tensor();
            let table = Tensor::<A, 2>::from_inner(table.clone());
            let target = Tensor::from_inner(target.clone());
            let kind = if iou { PixelLoss::Iou } else { PixelLoss::SquaredError };
            let loss = match (together, iou) {
                (true, _) => silhouette.loss_by_table(kind, vertices, table, target, None),
                (false, false) => mse_loss(silhouette.coverage_by_table(vertices, table), target),
                (false, true) => iou_loss(silhouette.coverage_by_table(vertices, table), target),
            };
            world.grad(&loss.mean().backward()).expect("the loss depends on the vertices");
            clock.elapsed().as_secs_f64() * 1e3
        };
        for iou in [false, true] {
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
                let pairs: Vec<[f64; 2]> = pool
                    .install(|| (0..STEPS).map(|_| [step(iou, true), step(iou, false)]).collect());
                let medians = [0, 1].map(|k| median(pairs.iter().map(|pair| pair[k])));
                let ratio = median(pairs.iter().map(|[one, two]| one / two));
                let ([one, two], loss) = (medians, if iou { "IoU" } else { "squared error" });
                println!("| {name} | {loss} | {threads} | {one:.2} | {two:.2} | {ratio:.2} |");
            }
        }
    }
    Ok(())
}

fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
