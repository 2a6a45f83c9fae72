//! Predicts the time of a step on more cores from its phases and their tasks, measured on one thread.
//!
//! ```text
//! cargo bench -p softrast-raster --bench phases            # all
//! cargo bench -p softrast-raster --bench phases -- W1      # those with W1 in their names
//! ```
//!
//! A step is projection, squared error to a disk in the op, and gradient with respect to the world vertices, in `f32`; in colour (W3) the
//! image in three channels, its loss, and gradients with respect to vertices and colours. All run on one thread here. Tasks of a phase may
//! run in parallel, phases are sequential, and work outside of tasks counts as one task. The prediction schedules the tasks of each phase
//! in order on N threads and sums the phases; the ratio of the times is the speed-up. Costs of threads and shared memory are excluded.

#[allow(dead_code, reason = "other benchmarks use the rest")]
mod coloured;
mod machine;
#[allow(dead_code, reason = "other benchmarks use the rest")]
mod workload;

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use coloured::Coloured;
use softrast_kernel::recorded_tasks;
use softrast_raster::{
    ColourRenderer,
    low_level::{PixelLoss, Rasterizer},
    project,
};
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};
use workload::{Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

type B = NdArray<f32>;
type A = Autodiff<B>;

/// Number of steps; the median is printed.
const STEPS: usize = 15;
const THREADS: [usize; 3] = [2, 8, 16];

/// Tasks of a step with their phases, and the time of the whole step.
type Recorded = (Vec<(&'static str, Duration)>, Duration);

fn main() {
    // Cargo adds the flag `--bench`.
    let filter = std::env::args().skip(1).find(|word| word != "--bench");
    println!("{}", machine::machine());
    let colours = Workload { name: "W3 (W2 in colours)".to_owned(), ..Workload::w2() };
    let all = [Workload::w1(), Workload::w2(), colours, Workload::w4(), Workload::w5()];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for workload in all {
        if filter.as_ref().is_some_and(|filter| !workload.name.contains(filter)) {
            continue;
        }
        let mut steps = pool.install(|| recorded(&workload));
        steps.sort_by_key(|(_, time)| *time);
        show(&workload.name, &steps[steps.len() / 2]);
    }
}

fn recorded(workload: &Workload) -> Vec<Recorded> {
    if workload.name.contains("colours") {
        let coloured = Coloured::<B>::new(workload, ColourRenderer::DEPTH_SCALE, DType::F32);
        return steps(|| drop(black_box(coloured.step())));
    }
    let size = workload.size;
    let (silhouette, table) = workload.prepare::<B>(Rasterizer::TOLERANCE, DType::F32);
    let (world, cameras) = (workload.world::<B>(DType::F32), workload.cameras::<B>(DType::F32));
    let target: Tensor<B, 3> = tensor(&disk(size), [1, size, size], DType::F32);
    steps(|| {
        let world = Tensor::<A, 3>::from_inner(world.clone()).require_grad();
        let vertices = project(world.clone(), Tensor::from_inner(cameras.clone())).tensor();
        let (table, target) =
            (Tensor::from_inner(table.clone()), Tensor::from_inner(target.clone()));
        let loss = silhouette.loss_by_table(PixelLoss::SquaredError, vertices, table, target, None);
        black_box(world.grad(&loss.mean().backward()).expect("the loss depends on the vertices"));
    })
}

fn steps(step: impl Fn()) -> Vec<Recorded> {
    let timed = || {
        let clock = Instant::now();
        step();
        clock.elapsed()
    };
    timed();
    let recorded = |_| {
        let (time, tasks) = recorded_tasks(timed);
        (tasks, time)
    };
    (0..STEPS).map(recorded).collect()
}

fn show(name: &str, (tasks, time): &Recorded) {
    println!("\n{name}");
    println!("{:<28} {:>6} {:>9} {:>12}", "phase", "tasks", "ms", "longest, ms");
    let mut phases: Vec<&str> = Vec::new();
    for (phase, _) in tasks {
        if !phases.contains(phase) {
            phases.push(phase);
        }
    }
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let (mut rest, mut ends) = (*time, [Duration::ZERO; THREADS.len()]);
    for phase in phases {
        let own: Vec<Duration> =
            tasks.iter().filter(|(of, _)| *of == phase).map(|(_, time)| *time).collect();
        let (sum, longest) = (own.iter().sum(), own.iter().max().copied().unwrap_or_default());
        println!("{phase:<28} {:>6} {:>9.3} {:>12.3}", own.len(), ms(sum), ms(longest));
        rest = rest.saturating_sub(sum);
        for (end, threads) in ends.iter_mut().zip(THREADS) {
            *end += in_parallel(&own, threads);
        }
    }
    println!("{:<28} {:>6} {:>9.3} {:>12.3}", "in no task", 1, ms(rest), ms(rest));
    println!("{:<28} {:>6} {:>9.3}", "all", "", ms(*time));
    for (end, threads) in ends.into_iter().zip(THREADS) {
        let gain = time.as_secs_f64() / (end + rest).as_secs_f64();
        println!("predicted on {threads} threads: {:.3} ms, a gain of {gain:.1}", ms(end + rest));
    }
}

/// Time of all tasks on `threads` threads, each of which takes the next task as soon as it is free.
fn in_parallel(tasks: &[Duration], threads: usize) -> Duration {
    let mut free = vec![Duration::ZERO; threads];
    for &task in tasks {
        let first = free.iter_mut().min().expect("a thread");
        *first += task;
    }
    free.into_iter().max().unwrap_or_default()
}
