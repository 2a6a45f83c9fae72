//! Peak memory of a meta-gradient through 3D SHAPE, and its growth.
//!
//! ```text
//! cargo run --release -p compare --features studies --example memory              # 10, 30 and 100 steps, other spheres and sizes
//! cargo run --release -p compare --features studies --example memory -- --quick   # 10 steps, to out/memory.md
//! ```
//!
//! Measures the exact meta-gradient with clipped adjoint, as `learn` uses it, for 24 views of a sphere of 1,280 faces on 64 × 64 pixels,
//! and in f64 with an error of 1e-5 per pixel, each setting in a separate process. Fails above 1 GiB. Writes `docs/studies/estimators.md`.

mod common;

use std::{
    env,
    process::{Command, Stdio},
    time::Instant,
};

use anyhow::{Context, bail, ensure};
use clap::Parser;
use common::{Study, constant, setup};
use shape3d::{Args, Shape3d};
use softrast_cli::{Common, MethodArgs};
use softrast_inverse::{Instances, LearnConfig};
use softrast_lab::{machine, peak_rss_mib, report::Table};
use softrast_meta::{MetaGradient, TaskDistribution};
use softrast_raster::RasterBackend;
use softrast_softness::Family;
use softrast_tensor::{NdArray, vector};

/// Limit of the peak memory, in MiB.
const LIMIT: f64 = 1024.0;

#[derive(Parser)]
struct Flags {
    #[command(flatten)]
    study: Study,
    /// Measure this setting alone, counted from 0, and print its numbers
    #[arg(long, value_name = "K")]
    only: Option<usize>,
}

/// The configuration of one measurement.
#[derive(Clone, Copy, Debug)]
struct Setting {
    /// Bits of a float: 32 or 64.
    bits: usize,
    tolerance: f64,
    /// Subdivisions of the sphere that is deformed.
    sphere: u32,
    size: usize,
    steps: usize,
}

const USUAL: Setting = Setting { bits: 32, tolerance: 1e-5, sphere: 3, size: 64, steps: 10 };

/// The usual sphere and size with several tolerances, float types and steps, then neighbouring spheres and sizes with few steps.
fn settings(quick: bool) -> Vec<Setting> {
    let steps: &[usize] = if quick { &[10] } else { &[10, 30, 100] };
    let exact = Setting { bits: 64, ..USUAL };
    let tolerances = [1e-5, 1e-3, 1e-2].map(|tolerance| Setting { tolerance, ..USUAL });
    let usual = tolerances.into_iter().chain([exact]);
    let usual =
        usual.flat_map(|setting| steps.iter().map(move |&steps| Setting { steps, ..setting }));
    let spheres = [USUAL.sphere - 1, USUAL.sphere + 1].map(|sphere| Setting { sphere, ..USUAL });
    let sizes = [USUAL.size / 2, USUAL.size * 2].map(|size| Setting { size, ..USUAL });
    usual.chain(spheres).chain(sizes).collect()
}

fn main() -> anyhow::Result<()> {
    let Flags { study, only } = Flags::parse();
    let settings = settings(study.quick);
    if let Some(k) = only {
        let setting = *settings.get(k).context("there are not so many settings")?;
        return match setting.bits {
            32 => measure::<NdArray<f32>>(setting),
            _ => measure::<NdArray<f64>>(setting),
        };
    }
    let head = ["floats", "tolerance", "steps", "vertices", "faces", "pixels", "numbers kept"];
    let rest = ["peak memory", "of that before the loop", "seconds"];
    let mut table = Table::new(head.into_iter().chain(rest));
    for (k, setting) in settings.into_iter().enumerate() {
        let [kept, before, peak, seconds] = in_a_process(k, study.quick)?;
        println!("{setting:?}: {kept} kept, {before:.0} to {peak:.0} MiB, {seconds:.1} s");
        let Setting { bits, tolerance, sphere, size, steps } = setting;
        let faces = 20 * 4_usize.pow(sphere);
        table.push([
            format!("f{bits}"),
            format!("{tolerance:e}"),
            steps.to_string(),
            (faces / 2 + 2).to_string(),
            faces.to_string(),
            format!("24 x {size}²"),
            kept.to_string(),
            format!("{peak:.0} MiB"),
            format!("{before:.0} MiB"),
            format!("{seconds:.1}"),
        ]);
        let usual = (sphere, size) == (USUAL.sphere, USUAL.size);
        ensure!(!usual || peak < LIMIT, "{steps} steps: {peak:.0} MiB, not below {LIMIT} MiB");
    }
    study.page("estimators.md", &format!("On {}.\n{}", machine(), table.markdown()))
}

/// Runs [`measure`] in a separate process, because a peak never falls, and returns the numbers that it prints.
fn in_a_process(k: usize, quick: bool) -> anyhow::Result<[f64; 4]> {
    let mut command = Command::new(env::current_exe()?);
    command.args(["--only", &k.to_string()]).args(quick.then_some("--quick"));
    let output = command.stderr(Stdio::inherit()).output()?;
    ensure!(output.status.success(), "a measurement failed");
    let text = String::from_utf8(output.stdout)?;
    let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let Ok(numbers) = numbers.try_into() else { bail!("a measurement printed {text:?}") };
    Ok(numbers)
}

/// Computes a gradient and prints the count of numbers stored by the inner loop for the backward pass, the peak memory in MiB after
/// creating the instance and at the end, and the seconds.
fn measure<B: RasterBackend>(setting: Setting) -> anyhow::Result<()> {
    let Setting { tolerance, sphere, size, steps, .. } = setting;
    let args = Args { detail: Some(sphere as usize), ..Args::default() };
    let common = Common { size: Some(size), steps: Some(steps), ..Common::default() };
    let method = MethodArgs { tolerance: Some(tolerance), ..constant(Family::Logistic) };
    let estimator = MetaGradient::default();
    let config = LearnConfig { estimator: Some(estimator), ..LearnConfig::default() };
    let (task, method, solve) = setup::<Shape3d>(&args, &common, &method)?;
    let instances = Instances::<_, B>::new(task, &method, &solve, &config)?;
    let phi = vector::<B>(&instances.start());
    let problem = instances.problem(config.seed, &phi);
    let peak = || peak_rss_mib().context("the system does not say how much memory is used");
    let (before, clock) = (peak()?, Instant::now());
    let estimate = estimator.estimate(&problem, &phi, 0);
    let seconds = clock.elapsed().as_secs_f64();
    ensure!(estimate.is_finite(), "the gradient is not finite");
    println!("{} {before} {} {seconds}", estimate.stored, peak()?);
    Ok(())
}
