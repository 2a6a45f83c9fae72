//! Peak memory of a meta-gradient through 3D SHAPE, and how it grows.
//!
//! ```text
//! cargo bench -p softrast-tests --bench memory                # 10, 30 and 100 steps, and what grows
//! cargo bench -p softrast-tests --bench memory -- 10          # fewer
//! ```
//!
//! 24 views of a sphere of 1,280 faces on 64 × 64 pixels, exact with the adjoint clipped, as `learn` takes it and in
//! f64 with an error of 1e-5 a pixel; every measurement in a process of its own. Fails above 1 GiB. Writes
//! `docs/estimators.md`.

mod learning;
#[path = "../../crates/raster/benches/machine.rs"]
mod machine;

use std::{
    env,
    fmt::Write,
    process::{Command, Stdio},
    time::Instant,
};

use anyhow::{Context, bail, ensure};
use burn::backend::NdArray;
use learning::{plan, task};
use shape3d::{Shape3d, Shape3dLesson};
use softrast_mesh::icosphere;
use softrast_meta::{MetaGradient, Tasks};
use softrast_method::Class;
use softrast_raster::RasterBackend;
use softrast_runner::{Order, Referee, peak_rss_mib};
use softrast_tests::vector;

/// What the peak has to stay below, in MiB.
const LIMIT: f64 = 1024.0;
/// Word that makes the program measure one setting.
const CHILD: &str = "one";

/// What is measured at once.
#[derive(Clone, Copy, Debug)]
struct Setting {
    /// 32 or 64.
    bits: usize,
    tolerance: f64,
    /// Subdivisions of the sphere that is deformed.
    sphere: usize,
    /// Pixels of a side.
    size: usize,
    steps: usize,
}

/// As `learn` takes it, but for the tolerance.
const USUAL: Setting = Setting { bits: 32, tolerance: 1e-5, sphere: 3, size: 64, steps: 100 };

fn main() -> anyhow::Result<()> {
    // Cargo adds a flag of its own.
    let words: Vec<String> = env::args().skip(1).filter(|word| word != "--bench").collect();
    if let [child, words @ ..] = &words[..]
        && child == CHILD
    {
        let [bits, tolerance, sphere, size, steps] = words else { bail!("five numbers") };
        let (bits, tolerance) = (bits.parse()?, tolerance.parse()?);
        let [sphere, size, steps] = [sphere.parse()?, size.parse()?, steps.parse()?];
        let setting = Setting { bits, tolerance, sphere, size, steps };
        return match bits {
            32 => one::<NdArray<f32>>(setting),
            _ => one::<NdArray<f64>>(setting),
        };
    }
    let steps = words.first().map_or("10,30,100", String::as_str);
    let steps = steps.split(',').map(str::parse).collect::<Result<Vec<usize>, _>>()?;
    let drawn = [1e-5, 1e-3, 1e-2].map(|tolerance| Setting { tolerance, ..USUAL });
    let drawn = drawn.into_iter().chain([Setting { bits: 64, ..USUAL }]);
    let usual =
        drawn.flat_map(|setting| steps.iter().map(move |&steps| Setting { steps, ..setting }));
    let few = Setting { steps: steps[0], ..USUAL };
    let grown = [
        Setting { sphere: few.sphere - 1, ..few },
        Setting { sphere: few.sphere + 1, ..few },
        Setting { size: few.size / 2, ..few },
        Setting { size: few.size * 2, ..few },
    ];
    let mut page = format!("On {}.\n\n", machine::machine());
    page += "| floats | tolerance | steps | vertices | faces | pixels | numbers kept | peak memory | of that before the loop | seconds |\n";
    page += "|---|---|---|---|---|---|---|---|---|---|\n";
    for setting in usual.chain(grown) {
        let measured = Measured::of(setting)?;
        println!("{setting:?}: {measured:?}");
        let Setting { bits, tolerance, sphere, size, steps } = setting;
        let Measured { kept, before, peak, seconds } = measured;
        let mesh = icosphere(sphere as u32);
        writeln!(
            page,
            "| f{bits} | {tolerance:e} | {steps} | {} | {} | 24 x {size}² | {kept} | {peak:.0} MiB | {before:.0} MiB | {seconds:.1} |",
            mesh.positions().len(),
            mesh.faces().len(),
        )?;
        let usual = (sphere, size) == (USUAL.sphere, USUAL.size);
        ensure!(!usual || peak < LIMIT, "{steps} steps: {peak:.0} MiB, not below {LIMIT} MiB");
    }
    learning::write("estimators.md", "memory", &page)
}

/// What one process found.
#[derive(Debug)]
struct Measured {
    /// Numbers kept from the inner loop for the way back.
    kept: usize,
    /// Peak memory in MiB once the instance was made, and at the end.
    before: f64,
    peak: f64,
    seconds: f64,
}

impl Measured {
    /// Measures in a process of its own, because a peak never falls.
    fn of(setting: Setting) -> anyhow::Result<Self> {
        let Setting { bits, tolerance, sphere, size, steps } = setting;
        let child = Command::new(env::current_exe()?)
            .args([CHILD, &bits.to_string(), &tolerance.to_string()])
            .args([sphere, size, steps].map(|number| number.to_string()))
            .stderr(Stdio::inherit())
            .output()?;
        ensure!(child.status.success(), "a measurement failed");
        let text = String::from_utf8(child.stdout)?;
        let last = text.lines().last().context("a measurement said nothing")?;
        let numbers = last.split(' ').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let [kept, before, peak, seconds] = numbers[..] else {
            bail!("a measurement said {last:?}")
        };
        Ok(Self { kept: kept as usize, before, peak, seconds })
    }
}

/// Prints what [`Measured`] holds.
fn one<B: RasterBackend>(setting: Setting) -> anyhow::Result<()> {
    let Setting { tolerance, sphere, size, steps, .. } = setting;
    let folder = tempfile::tempdir()?;
    let template = folder.path().join("sphere.obj");
    icosphere(sphere as u32).write_obj(&template)?;
    let flags = format!(
        "--softness logistic --schedule static --tolerance {tolerance} --size {size} --steps {steps} --template {}",
        template.display()
    );
    let plan = plan(Order::Unrolled, Referee::Fixed);
    let lesson = Shape3dLesson::new(task::<Shape3d>(&flags)?, &plan);
    let phi = vector::<B>(&softrast_method::Lesson::start(&lesson));
    let class = Class::new(lesson, &plan);
    let problem = class.problem(plan.seed, &phi);
    let peak = || peak_rss_mib().context("the system does not say how much memory is used");
    let (before, clock) = (peak()?, Instant::now());
    let estimate = MetaGradient::default().estimate(&problem, &phi, 0);
    let seconds = clock.elapsed().as_secs_f64();
    ensure!(estimate.is_finite(), "the gradient is not finite");
    eprintln!("loss {} gradient {:?}", estimate.loss, estimate.gradient.to_data());
    println!("{} {before} {} {seconds}", estimate.stored, peak()?);
    Ok(())
}
