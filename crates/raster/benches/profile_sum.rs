//! Times of the fused op: image, gradient, and gradient of the gradient.
//!
//! ```text
//! cargo bench -p softrast-raster --bench profile_sum            # all, about four minutes
//! cargo bench -p softrast-raster --bench profile_sum -- W1      # those with W1 in their names
//! ```
//!
//! All calls use the public burn API in `f32`. The first rows start at projected vertices: `forward` is the sum, `vjp` the backward pass of
//! `Σ w · sum` with respect to the vertices, `vjp_of_vjp` the backward pass of `Σ u · vjp`. `scalar` is the plain version in `scalar.rs`. A
//! `step` is an iteration of an optimisation: projection, image, mean squared difference, gradient with respect to the world vertices.
//! Throughput counts pixel-face pairs that the op visits. Widths are those of a logistic of the squared distance, in NDC. A complete run
//! writes the medians to `docs/studies/speed.md`.

mod machine;
mod record;
mod scalar;
#[allow(dead_code, reason = "other benchmarks use the rest")]
mod workload;

use std::{
    error::Error,
    fmt::Write,
    hint::black_box,
    path::Path,
    time::{Duration, Instant},
};

use machine::machine;
use rayon::ThreadPool;
use record::Record;
use scalar::Scalar;
use softrast_raster::{
    low_level::{PixelLoss, Rasterizer, Silhouette},
    project,
};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};
use workload::{Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

type B = NdArray<f32>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

/// Cells with more pairs than this take seconds per pass, and are skipped; the plain version is skipped much earlier.
const MOST_PAIRS: usize = 60_000_000;
const MOST_PLAIN_PAIRS: usize = 4_000_000;

/// Each measurement runs unrecorded for `WARM_UP`, then as `SAMPLES` samples that take `MEASUREMENT` in total.
const WARM_UP: Duration = Duration::from_millis(150);
const MEASUREMENT: Duration = Duration::from_millis(500);
const SAMPLES: usize = 10;

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo adds the flag `--bench`.
    let filter = std::env::args().skip(1).find(|word| word != "--bench");
    let machine = machine();
    let bench = Bench { record: Record::default(), pools: [1, 2].map(pool), filter };
    for (name, workload) in [("W1", Workload::w1()), ("W2", Workload::w2())] {
        println!("{name} is {}", workload.name);
        bench.passes(name, &workload.name, &workload);
        let mlp = under_mlp(&workload);
        bench.step(name, &format!("{name}, logistic"), &workload);
        bench.step(name, &format!("{name}, MLP"), &mlp);
    }
    let sphere = softrast_mesh::icosphere(5);
    for size in [256, 1024] {
        let group = format!("20k faces, {size} px");
        for width in [1e-5, 1e-4, 1e-3, 1e-2, 1e-1] {
            let workload = Workload { width, ..Workload::new("", &sphere, &[30.0], size) };
            let pairs = Op::new(&workload).pairs();
            let name = format!("20,480 faces, {size} px, width {width:e}");
            if pairs > MOST_PAIRS {
                println!("left out: {name}: {pairs} pairs");
                continue;
            }
            bench.passes(&group, &name, &workload);
        }
    }
    // With a filter, some rows are missing.
    if bench.filter.is_none() {
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies/speed.md");
        record::write(&page, &bench.tables(&machine)?)?;
    }
    Ok(())
}

/// The scene with an MLP softness of the same support.
fn under_mlp(workload: &Workload) -> Workload {
    let softness = EdgeSoftness::squared(Family::Mlp);
    let reach = |workload: &Workload| {
        let (silhouette, _) = workload.prepare::<B>(Rasterizer::TOLERANCE, DType::F32);
        silhouette.profile().support()[0]
    };
    let mut mlp = Workload {
        name: workload.name.clone(),
        faces: workload.faces.clone(),
        vertices: workload.vertices.clone(),
        orbits: workload.orbits.clone(),
        softness,
        ..*workload
    };
    mlp.width *= reach(workload) / reach(&mlp);
    mlp
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

    /// The tape of `Σ upstream · sums`: the loss, and the vertices to differentiate with respect to.
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

/// Runs measurements on one thread and on two, and records them.
struct Bench {
    record: Record,
    pools: [ThreadPool; 2],
    /// A substring of the names of the measurements to run; all if absent.
    filter: Option<String>,
}

/// Position of a time on the page.
struct Cell<'a> {
    row: &'a str,
    pairs: usize,
    column: &'static str,
}

const COLUMNS: [[&str; 2]; 5] = [
    ["forward, 1 thread", "forward, 2 threads"],
    ["vjp, 1 thread", "vjp, 2 threads"],
    ["vjp_of_vjp, 1 thread", "vjp_of_vjp, 2 threads"],
    ["step, 1 thread", "step, 2 threads"],
    ["step with its table, 1 thread", "step with its table, 2 threads"],
];
const PLAIN: [&str; 2] = ["scalar forward, 1 thread", "scalar vjp, 1 thread"];

impl Bench {
    /// Times `run` on the result of `prepare`, which is not timed.
    fn time<I, O>(&self, group: &str, cell: Cell, prepare: impl Fn() -> I, run: impl Fn(I) -> O) {
        let Cell { row, pairs, column } = cell;
        let name = format!("{group}/{row}, {column}");
        if self.filter.as_ref().is_some_and(|filter| !name.contains(filter)) {
            return;
        }
        let timed = || {
            let input = prepare();
            let start = Instant::now();
            let output = black_box(run(input));
            let time = start.elapsed();
            drop(output);
            time
        };
        let (start, mut warm) = (Instant::now(), 0);
        while warm == 0 || start.elapsed() < WARM_UP {
            timed();
            warm += 1;
        }
        let per_sample = MEASUREMENT.as_secs_f64() / SAMPLES as f64;
        let iterations = (per_sample * warm as f64 / start.elapsed().as_secs_f64()) as u64;
        for _ in 0..SAMPLES {
            let total = (0..iterations.max(1)).map(|_| timed()).sum();
            self.record.note(row, pairs, column, total, iterations.max(1));
        }
        let median = self.record.median(row, column).unwrap_or(f64::NAN);
        println!(
            "{name}: {median:.3} ms, {:.0} million pairs per second",
            pairs as f64 / median / 1e3
        );
    }

    /// All three passes, and the plain version with the same support.
    fn passes(&self, group: &str, row: &str, workload: &Workload) {
        let op = Op::new(workload);
        let pairs = op.pairs();
        let cell = |column| Cell { row, pairs, column };
        for (k, pool) in self.pools.iter().enumerate() {
            let [forward, vjp, vjp_of_vjp] = [0, 1, 2].map(|pass| cell(COLUMNS[pass][k]));
            let backward = |tape| pool.install(|| backward(tape));
            self.time(group, forward, || (), |()| pool.install(|| op.forward()));
            self.time(group, vjp, || pool.install(|| op.taped()), backward);
            self.time(group, vjp_of_vjp, || pool.install(|| op.taped_gradient()), backward);
        }
        if pairs <= MOST_PLAIN_PAIRS {
            let plain = Plain::new(workload);
            self.time(group, cell(PLAIN[0]), || (), |()| plain.forward());
            self.time(group, cell(PLAIN[1]), || (), |()| plain.gradient());
        }
    }

    /// Whole steps: with a fixed table, and with a table computed in each step.
    fn step(&self, group: &str, row: &str, workload: &Workload) {
        let step = Step::new(workload);
        let pairs = step.op.pairs();
        for (k, pool) in self.pools.iter().enumerate() {
            let cell = |pass: usize| Cell { row, pairs, column: COLUMNS[pass][k] };
            let table = || step.op.table.clone();
            self.time(group, cell(3), table, |table| pool.install(|| step.gradient(table)));
            let made = || step.gradient(step.op.silhouette.table(step.phi.clone()));
            self.time(group, cell(4), || (), |()| pool.install(made));
        }
    }

    /// The page's tables.
    fn tables(&self, machine: &str) -> Result<String, std::fmt::Error> {
        let mut text = String::new();
        writeln!(text, "Medians in ms on {machine}.\n")?;
        writeln!(
            text,
            "| scene | pairs | forward, 1 and 2 threads | vjp | vjp of vjp | scalar forward + vjp, 1 thread | \
             ratio to it, 1 and 2 threads | vjp of vjp / vjp, 1 thread |\n|---|---|---|---|---|---|---|---|"
        )?;
        let rows = self.record.rows();
        for (row, pairs) in &rows {
            let at = |column: &str| self.record.median(row, column);
            let pass = |pass: usize| Some([at(COLUMNS[pass][0])?, at(COLUMNS[pass][1])?]);
            let (Some(forward), Some(vjp), Some(second)) = (pass(0), pass(1), pass(2)) else {
                continue;
            };
            let two = |[one, two]: [f64; 2]| format!("{one:.2}, {two:.2}");
            let plain = at(PLAIN[0]).zip(at(PLAIN[1])).map(|(forward, vjp)| forward + vjp);
            let ratio = |plain: f64| {
                let [one, two] = [0, 1].map(|k| plain / (forward[k] + vjp[k]));
                format!("{one:.1} x, {two:.1} x")
            };
            writeln!(
                text,
                "| {row} | {pairs} | {} | {} | {} | {} | {} | {:.1} |",
                two(forward),
                two(vjp),
                two(second),
                plain.map_or("not run".to_owned(), |ms| format!("{ms:.2}")),
                plain.map_or(String::new(), ratio),
                second[0] / vjp[0]
            )?;
        }
        writeln!(
            text,
            "\n| step | pairs | table given, 1 and 2 threads | table made anew each step |\n|---|---|---|---|"
        )?;
        for (row, pairs) in &rows {
            let at = |pass: usize| {
                let cells = COLUMNS[pass].map(|column| self.record.median(row, column));
                cells[0].zip(cells[1]).map(|(one, two)| format!("{one:.2}, {two:.2}"))
            };
            if let (Some(given), Some(made)) = (at(3), at(4)) {
                writeln!(text, "| {row} | {pairs} | {given} | {made} |")?;
            }
        }
        Ok(text)
    }
}

/// A workload as a step of an optimisation.
struct Step {
    op: Op,
    phi: Tensor<B, 1>,
    world: Tensor<B, 3>,
    cameras: Tensor<B, 2>,
    target: Tensor<B, 3>,
}

impl Step {
    fn new(workload: &Workload) -> Self {
        let cameras = workload.cameras(DType::F32);
        let size = workload.size;
        let target = tensor(&disk(size), [1, size, size], DType::F32);
        Self {
            op: Op::new(workload),
            phi: workload.phi(DType::F32),
            world: workload.world(DType::F32),
            target,
            cameras,
        }
    }

    fn gradient(&self, table: Tensor<B, 2>) -> Tensor<B, 3> {
        let world = Tensor::<A, 3>::from_inner(self.world.clone()).require_grad();
        let vertices = project(world.clone(), Tensor::from_inner(self.cameras.clone())).tensor();
        let (table, target) = (Tensor::from_inner(table), Tensor::from_inner(self.target.clone()));
        let mse = PixelLoss::SquaredError;
        let loss = self.op.silhouette.loss_by_table(mse, vertices, table, target, None).mean();
        backward((loss, world))
    }
}

/// A workload for the plain version, with the support of the fused one.
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
}
