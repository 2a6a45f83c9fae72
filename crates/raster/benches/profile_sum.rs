//! Times of the fused op: image, gradient, and gradient of the gradient.
//!
//! ```text
//! cargo bench -p softrast-raster --bench profile_sum            # all, about five minutes
//! cargo bench -p softrast-raster --bench profile_sum -- W1      # what has W1 in its name
//! ```
//!
//! Everything goes through the public burn API in `f32` and starts at projected vertices: `forward`
//! is the sum, `vjp` the backward pass of `Σ w · sum` to the vertices, `vjp_of_vjp` the backward
//! pass of `Σ u · vjp`. `scalar` is the plain version in `scalar.rs`; the last lines give the ratio
//! to it. Throughput counts pixel-face pairs that the op visits. Widths are those of a logistic of
//! the squared distance, in NDC.

mod scalar;
mod workload;

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{DType, Tensor},
};
use criterion::{BatchSize, BenchmarkGroup, Criterion, Throughput, measurement::WallTime};
use rayon::ThreadPool;
use scalar::Scalar;
use softrast_raster::{Rasterizer, Silhouette};
use softrast_softness::EdgeSoftness;
use workload::{Workload, tensor};

type B = NdArray<f32>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

/// Cells with more pairs than this take seconds a pass, and are left out.
const MOST_PAIRS: usize = 1_000_000_000;

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(700))
        .configure_from_args();
    for (name, workload) in [("W1", Workload::w1()), ("W2", Workload::w2())] {
        println!("{name} is {}", workload.name);
        let mut group = criterion.benchmark_group(name);
        passes(&mut group, "", &Op::new(&workload));
        Plain::new(&workload).bench(&mut group);
    }
    let sphere = softrast_mesh::icosphere(5);
    for size in [256, 1024] {
        let mut group = criterion.benchmark_group(format!("20k faces, {size} px"));
        for width in [1e-5, 1e-4, 1e-3, 1e-2, 1e-1] {
            let workload = Workload { width, ..Workload::new("", &sphere, &[30.0], size) };
            let op = Op::new(&workload);
            let pairs = op.pairs();
            if pairs > MOST_PAIRS {
                println!("left out: 20k faces, {size} px, width {width:e}: {pairs} pairs");
                continue;
            }
            passes(&mut group, &format!("width {width:e}, "), &op);
        }
    }
    criterion.final_summary();
    // Without this argument everything runs once, as a test.
    if std::env::args().any(|word| word == "--bench") {
        ratios();
    }
}

/// One workload, ready for the op.
struct Op {
    silhouette: Silhouette<EdgeSoftness>,
    table: Tensor<B, 2>,
    vertices: Tensor<B, 3>,
    /// Weights of the pixels, and of the gradient's entries.
    upstream: Tensor<B, 3>,
    direction: Tensor<B, 3>,
}

impl Op {
    fn new(workload: &Workload) -> Self {
        let (silhouette, table) = workload.prepare(Rasterizer::TOLERANCE, DType::F32);
        let vertices = workload.projected::<B>(DType::F32);
        let waves = |shape: [usize; 3]| {
            let count: usize = shape.iter().product();
            let waves: Vec<f64> = (0..count).map(|k| (0.1 * k as f64).sin()).collect();
            tensor(&waves, shape, DType::F32)
        };
        let [views, count, _] = vertices.dims();
        let upstream = waves([views, workload.size, workload.size]);
        Self { silhouette, table, upstream, direction: waves([views, count, 3]), vertices }
    }

    fn pairs(&self) -> usize {
        self.silhouette.pairs(self.vertices.clone())
    }

    fn forward(&self) -> Tensor<B, 3> {
        self.silhouette.sums(self.vertices.clone(), self.table.clone())
    }

    /// The tape of `Σ upstream · sums`: what to differentiate, and by what.
    fn taped(&self) -> (Tensor<A, 1>, Tensor<A, 3>) {
        let vertices = Tensor::<A, 3>::from_inner(self.vertices.clone()).require_grad();
        let table = Tensor::from_inner(self.table.clone());
        let sums = self.silhouette.sums(vertices.clone(), table);
        ((sums * Tensor::from_inner(self.upstream.clone())).sum(), vertices)
    }

    /// The tape of `Σ direction · gradient`.
    fn taped_gradient(&self) -> (Tensor<A, 1>, Tensor<A, 3>) {
        let inner = Tensor::<A, 3>::from_inner(self.vertices.clone()).require_grad();
        let vertices = Tensor::<AA, 3>::from_inner(inner.clone()).require_grad();
        let up = |tensor| Tensor::<AA, 3>::from_inner(Tensor::from_inner(tensor));
        let table = Tensor::<AA, 2>::from_inner(Tensor::from_inner(self.table.clone()));
        let sums = self.silhouette.sums(vertices.clone(), table);
        let grads = (sums * up(self.upstream.clone())).sum().backward();
        let grad = vertices.grad(&grads).expect("sums depend on vertices");
        ((grad * Tensor::from_inner(self.direction.clone())).sum(), inner)
    }
}

fn backward((loss, vertices): (Tensor<A, 1>, Tensor<A, 3>)) -> Tensor<B, 3> {
    vertices.grad(&loss.backward()).expect("the loss depends on the vertices")
}

fn pool(threads: usize) -> ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started")
}

/// All three passes on one thread and on two.
fn passes(group: &mut BenchmarkGroup<WallTime>, prefix: &str, op: &Op) {
    group.throughput(Throughput::Elements(op.pairs() as u64));
    for threads in [1, 2] {
        let pool = pool(threads);
        let plural = if threads == 1 { "" } else { "s" };
        let name = |pass: &str| format!("{prefix}{pass}, {threads} thread{plural}");
        group.bench_function(name("forward"), |b| b.iter(|| pool.install(|| op.forward())));
        let backward = |tape| pool.install(|| backward(tape));
        group.bench_function(name("vjp"), |b| {
            b.iter_batched(|| pool.install(|| op.taped()), backward, BatchSize::PerIteration);
        });
        group.bench_function(name("vjp_of_vjp"), |b| {
            let tape = || pool.install(|| op.taped_gradient());
            b.iter_batched(tape, backward, BatchSize::PerIteration);
        });
    }
}

/// One workload for the plain version, with the support of the fused one.
struct Plain<'a> {
    scalar: Scalar<'a>,
    vertices: Vec<f32>,
    upstream: Vec<f32>,
    count: usize,
}

impl<'a> Plain<'a> {
    fn new(workload: &'a Workload) -> Self {
        let op = Op::new(workload);
        let [radius, _] = op.silhouette.profile().support();
        let scale = (workload.width * workload.width) as f32;
        let (faces, size) = (&workload.faces[..], workload.size);
        Self {
            scalar: Scalar { faces, size, scale, radius: radius as f32 },
            vertices: op.vertices.into_data().iter().collect(),
            upstream: op.upstream.into_data().iter().collect(),
            count: workload.vertices.len() / 3,
        }
    }

    fn forward(&self) -> Vec<f32> {
        self.scalar.forward(&self.vertices, self.count)
    }

    fn gradient(&self) -> Vec<f32> {
        self.scalar.gradient(&self.vertices, self.count, &self.upstream)
    }

    fn bench(&self, group: &mut BenchmarkGroup<WallTime>) {
        group.bench_function("scalar forward, 1 thread", |b| b.iter(|| self.forward()));
        group.bench_function("scalar vjp, 1 thread", |b| b.iter(|| self.gradient()));
    }
}

/// Times of forward and gradient together against the plain version, by turns.
fn ratios() {
    const TURNS: usize = 31;
    let pools = [1, 2].map(pool);
    for workload in [Workload::w1(), Workload::w2()] {
        let (plain, op) = (Plain::new(&workload), Op::new(&workload));
        let mut times = [(); 3].map(|()| Vec::with_capacity(TURNS));
        for _ in 0..TURNS {
            times[0].push(milliseconds(|| (plain.forward(), plain.gradient())));
            for (times, pool) in times[1..].iter_mut().zip(&pools) {
                times.push(pool.install(|| milliseconds(|| backward(op.taped()))));
            }
        }
        let [plain, one, two] = times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[TURNS / 2]
        });
        println!(
            "{}: forward and gradient, scalar {plain:.2} ms; fused on 1 thread {one:.2} ms \
             ({:.1} x), on 2 threads {two:.2} ms ({:.1} x)",
            workload.name,
            plain / one,
            plain / two
        );
    }
}

fn milliseconds<T>(work: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    black_box(work());
    start.elapsed().as_secs_f64() * 1e3
}
