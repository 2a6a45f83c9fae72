//! Peak memory of a meta-gradient through 3D SHAPE, and how it grows.
//!
//! ```text
//! cargo bench -p softrast-tests --bench memory                # 10, 30 and 100 steps, and what grows
//! cargo bench -p softrast-tests --bench memory -- 10          # fewer
//! ```
//!
//! 24 views of a sphere of 1,280 faces on 64 × 64 pixels in f64, exact with the adjoint clipped; every
//! measurement in a process of its own. Fails above 1 GiB. Writes `docs/estimators.md`.

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
use softrast_runner::{Order, Referee, peak_rss_mib};
use softrast_tests::vector;

type B = NdArray<f64>;

/// What the peak has to stay below, in MiB.
const LIMIT: f64 = 1024.0;
/// Word that makes the program measure one setting.
const CHILD: &str = "one";
/// Subdivisions of the sphere that is deformed, and pixels of a side.
const USUAL: [usize; 2] = [3, 64];

fn main() -> anyhow::Result<()> {
    // Cargo adds a flag of its own.
    let words: Vec<String> = env::args().skip(1).filter(|word| word != "--bench").collect();
    if let [child, numbers @ ..] = &words[..]
        && child == CHILD
    {
        let numbers = numbers.iter().map(|word| word.parse()).collect::<Result<Vec<usize>, _>>()?;
        let [subdivisions, size, steps] = numbers[..] else { bail!("three numbers") };
        return one([subdivisions, size], steps);
    }
    let steps = words.first().map_or("10,30,100", String::as_str);
    let steps = steps.split(',').map(str::parse).collect::<Result<Vec<usize>, _>>()?;
    let [sphere, size] = USUAL;
    let usual = steps.iter().map(|&steps| (USUAL, steps));
    let grown = [[sphere - 1, size], [sphere + 1, size], [sphere, size / 2], [sphere, 2 * size]];
    let grown = grown.map(|setting| (setting, steps[0]));
    let mut page = format!("f64, on {}.\n\n", machine::machine());
    page += "| steps | vertices | faces | pixels | numbers kept | peak memory | of that before the loop | seconds |\n";
    page += "|---|---|---|---|---|---|---|---|\n";
    for (setting, steps) in usual.chain(grown) {
        let measured = Measured::of(setting, steps)?;
        println!("{setting:?}, {steps} steps: {measured:?}");
        let ([subdivisions, size], mesh) = (setting, icosphere(setting[0] as u32));
        let Measured { kept, before, peak, seconds } = measured;
        writeln!(
            page,
            "| {steps} | {} | {} | 24 x {size}² | {kept} | {peak:.0} MiB | {before:.0} MiB | {seconds:.1} |",
            mesh.positions().len(),
            mesh.faces().len(),
        )?;
        let usual = [subdivisions, size] == USUAL;
        ensure!(!usual || peak < LIMIT, "{steps} steps: {peak:.0} MiB, not below {LIMIT} MiB");
    }
    learning::write("memory", &page)
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
    fn of([subdivisions, size]: [usize; 2], steps: usize) -> anyhow::Result<Self> {
        let child = Command::new(env::current_exe()?)
            .arg(CHILD)
            .args([subdivisions, size, steps].map(|number| number.to_string()))
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
fn one([subdivisions, size]: [usize; 2], steps: usize) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let template = folder.path().join("sphere.obj");
    icosphere(subdivisions as u32).write_obj(&template)?;
    let flags = format!(
        "--softness logistic --schedule static --size {size} --steps {steps} --template {}",
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
    println!("{} {before} {} {seconds}", estimate.stored, peak()?);
    Ok(())
}
