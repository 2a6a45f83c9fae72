//! Compares the bundled networks with curves of one parameter: their shapes, the directions in which they can move, and the effect of such
//! moves on the loss.
//!
//! ```text
//! cargo run --release -p compare --features studies --example network              # about 10 minutes
//! cargo run --release -p compare --features studies --example network -- --quick   # tiny instances, to out/
//! ```
//!
//! Writes a part of `docs/studies/network.md`.

#[allow(dead_code, reason = "not every study uses all of it")]
mod common;

use clap::Parser;
use common::{Study, setup};
use shape2d::{Args, Shape2d};
use softrast_cli::{Common, MethodArgs, usual_args};
use softrast_inverse::{Instances, LearnConfig, OuterLoss, ScheduledSoftness};
use softrast_lab::{machine, mean, mean_interval, report::Table};
use softrast_meta::TaskDistribution;
use softrast_raster::HostBackend as B;
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{numbers, tensor_on, vector};

/// Names of the bundled networks, one per task.
const NETWORKS: [&str; 4] = ["shape2d-mlp", "shape3d-mlp", "pose-mlp", "occlusion-mlp"];
/// Curves that a network is compared with.
const CURVES: [Family; 2] = [Family::Gauss, Family::Logistic];
/// Number of signed distances to either side of 0 at which functions are compared, and the largest, in widths of the function.
const POINTS: usize = 200;
const REACH: f64 = 8.0;
/// Change of a weight for its slope, and number of directions considered.
const STEP: f64 = 1e-4;
const MOST: usize = 12;
/// Largest changes of coverage along each direction.
const CHANGES: [f64; 8] = [-0.2, -0.1, -0.05, -0.02, 0.02, 0.05, 0.1, 0.2];
/// Number of weight directions in which the function moves most, in addition to its width, and of random ones.
const LEADING: usize = 3;
const RANDOM: usize = 2;

fn main() -> anyhow::Result<()> {
    let study = Study::parse();
    let mut page = format!("On {}.\n", machine());
    page += &shapes()?.markdown();
    page += &landscape(&study)?;
    study.page("network.md", &page)
}

/// A network; its functions are compared over the distance in units of its width.
struct Network {
    softness: EdgeSoftness,
    phi: Vec<f64>,
    width: f64,
}

impl Network {
    fn new(softness: EdgeSoftness, phi: &[f64]) -> Self {
        Self { softness, phi: phi.to_vec(), width: half_width(softness, phi) }
    }

    /// Coverage at all points under other weights.
    fn values(&self, phi: &[f64]) -> Vec<f64> {
        values(self.softness, &self.softness.with_scale_values(phi, 1.0 / self.width))
    }

    /// Derivatives of the function with respect to the weights, one row per point.
    fn slopes(&self) -> Vec<Vec<f64>> {
        let moved = |k: usize, by: f64| {
            let mut phi = self.phi.clone();
            phi[k] += by;
            self.values(&phi)
        };
        let slope = |k: usize| -> Vec<f64> {
            let (up, down) = (moved(k, STEP), moved(k, -STEP));
            up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * STEP)).collect()
        };
        let columns: Vec<Vec<f64>> = (0..self.phi.len()).map(slope).collect();
        (0..=2 * POINTS).map(|row| columns.iter().map(|column| column[row]).collect()).collect()
    }
}

/// Coverage of a softness at all points.
fn values(softness: EdgeSoftness, phi: &[f64]) -> Vec<f64> {
    let points = (0..=2 * POINTS).map(|k| REACH * (k as f64 / POINTS as f64 - 1.0));
    covered(softness, phi, points.collect())
}

fn covered(softness: EdgeSoftness, phi: &[f64], points: Vec<f64>) -> Vec<f64> {
    let device = Default::default();
    let shape = [points.len()];
    let x = tensor_on::<B, 1>(points, shape, &device);
    numbers(softness.value(vector::<B>(phi), x))
}

/// Half the distance between coverages of a quarter and three quarters.
fn half_width(softness: EdgeSoftness, phi: &[f64]) -> f64 {
    let at = |wanted: f64| {
        let (mut low, mut high) = (-20.0, 20.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let below = covered(softness, phi, vec![middle])[0] < wanted;
            (low, high) = if below { (middle, high) } else { (low, middle) };
        }
        0.5 * (low + high)
    };
    0.5 * (at(0.75) - at(0.25))
}

/// The largest difference of two functions.
fn difference(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Smallest distance of a family's curve to a function, over all scales.
fn distance(family: Family, function: &[f64]) -> f64 {
    let softness = EdgeSoftness::new(family);
    let at = |log: f64| difference(&values(softness, &softness.default_phi(log.exp())), function);
    let (mut low, mut high) = (-3.0, 3.0);
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        (low, high) = if at(a) < at(b) { (low, b) } else { (a, high) };
    }
    at(0.5 * (low + high))
}

/// Orthogonal weight directions in which the function moves most, and the movement along each, by the power method on the Gram matrix of
/// the slopes.
fn directions(slopes: &[Vec<f64>], count: usize) -> Vec<(Vec<f64>, f64)> {
    let weights = slopes[0].len();
    let mut found: Vec<(Vec<f64>, f64)> = Vec::new();
    for k in 0..count {
        let mut direction: Vec<f64> =
            (0..weights).map(|i| 1.0 + (1.7 * (i + 31 * k) as f64).sin()).collect();
        let mut moves = 0.0;
        for _ in 0..500 {
            for (other, _) in &found {
                let along = dot(&direction, other);
                direction.iter_mut().zip(other).for_each(|(x, o)| *x -= along * o);
            }
            unit(&mut direction);
            let seen: Vec<f64> = slopes.iter().map(|row| dot(row, &direction)).collect();
            moves = dot(&seen, &seen).sqrt();
            direction = (0..weights)
                .map(|i| slopes.iter().zip(&seen).map(|(row, s)| row[i] * s).sum())
                .collect();
        }
        unit(&mut direction);
        found.push((direction, moves));
    }
    found
}

fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

fn unit(direction: &mut [f64]) {
    let length = dot(direction, direction).sqrt().max(f64::MIN_POSITIVE);
    direction.iter_mut().for_each(|x| *x /= length);
}

/// Table of the networks' shapes.
fn shapes() -> anyhow::Result<Table> {
    let mut table = Table::new([
        "network",
        "nearest Gauss curve",
        "nearest logistic",
        "directions for 90, 99 and 99.9 % of its squared movement",
    ]);
    for name in NETWORKS {
        let learned = ScheduledSoftness::learned(name)?;
        let network = Network::new(learned.softness, &learned.phi);
        let function = network.values(&network.phi);
        let slopes = network.slopes();
        let found = directions(&slopes, MOST);
        let all: f64 = slopes.iter().map(|row| dot(row, row)).sum();
        let enough = |share: f64| {
            let mut sum = 0.0;
            let reached = found.iter().position(|(_, moves)| {
                sum += moves * moves;
                sum >= share * all
            });
            reached.map_or(format!("more than {MOST}"), |k| (k + 1).to_string())
        };
        let [gauss, logistic] = CURVES.map(|family| format!("{:.3}", distance(family, &function)));
        let enough = [0.9, 0.99, 0.999].map(enough).join(", ");
        table.push([name.to_owned(), gauss, logistic, enough]);
    }
    Ok(table)
}

/// Returned errors of 2D SHAPE with a moved network. The instances are small, because coverage that does not vanish far from a face pairs
/// every pixel with every face.
fn landscape(study: &Study) -> anyhow::Result<String> {
    let (runs, size, triangles, steps) =
        if study.quick { (2, 16, 24, 20) } else { (40, 64, 100, 100) };
    let args = Args { triangles: Some(triangles), ..usual_args() };
    let common = Common { size: Some(size), steps: Some(steps), ..Common::default() };
    let method = MethodArgs::parse("learned-mlp").map_err(anyhow::Error::msg)?;
    let (problem, method, solve) = setup::<Shape2d>(&args, &common, &method)?;
    let config = LearnConfig { outer_loss: Some(OuterLoss::Returned), ..LearnConfig::default() };
    let instances = Instances::<_, B>::new(problem, &method, &solve, &config)?;
    let start = instances.start();
    let knots = method.softness.schedule.as_ref().map_or(0, |schedule| schedule.knots.len());
    let weights = method.softness.phi.len();
    let network = Network::new(method.softness.softness, &start[knots..knots + weights]);
    let own = network.values(&network.phi);
    let mut lines: Vec<(String, Option<Vec<f64>>)> = vec![("width".to_owned(), None)];
    for (k, (direction, _)) in directions(&network.slopes(), LEADING).into_iter().enumerate() {
        lines.push((format!("direction {}", k + 1), Some(direction)));
    }
    for k in 0..RANDOM {
        let mut direction: Vec<f64> = (0..weights)
            .map(|i| (12.9898 * (i + 97 * k + 1) as f64).sin() * 43758.5453 % 1.0)
            .collect();
        unit(&mut direction);
        lines.push((format!("random {}", k + 1), Some(direction)));
    }
    let returned = |phi: &[f64]| -> Vec<f64> {
        (0..runs as u64)
            .map(|seed| {
                let seed = config.validation_seed + seed;
                instances.validation_loss(seed, &vector::<B>(phi)).powi(2)
            })
            .collect()
    };
    let here = returned(&start);
    let mut table = Table::new(
        std::iter::once("largest change of coverage".to_owned())
            .chain(CHANGES.iter().map(|change| format!("{change:+}"))),
    );
    for (name, direction) in &lines {
        let mut row = vec![name.clone()];
        for change in CHANGES {
            let moved = |by: f64| {
                let mut phi = start.clone();
                match direction {
                    None => phi[..knots].iter_mut().for_each(|knot| *knot += by),
                    Some(direction) => phi[knots..knots + weights]
                        .iter_mut()
                        .zip(direction)
                        .for_each(|(x, d)| *x += by * d),
                }
                phi
            };
            let changed = |by: f64| {
                let phi = match direction {
                    None => network.softness.with_scale_values(&network.phi, by.exp()),
                    Some(_) => moved(by)[knots..knots + weights].to_vec(),
                };
                difference(&network.values(&phi), &own)
            };
            let sign = f64::signum(change);
            let (mut low, mut high) = (0.0, 1e-3);
            while changed(sign * high) < change.abs() && high < 100.0 {
                high *= 2.0;
            }
            anyhow::ensure!(
                changed(sign * high) >= change.abs(),
                "{name} does not change the coverage by {change}"
            );
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                let little = changed(sign * middle) < change.abs();
                (low, high) = if little { (middle, high) } else { (low, middle) };
            }
            let losses = returned(&moved(sign * high));
            let less: Vec<f64> = losses.iter().zip(&here).map(|(a, b)| a - b).collect();
            row.push(told(&less, mean(&here)));
            println!("{name}, {change}: {:.5}", mean(&losses));
        }
        table.push(row);
    }
    Ok(format!(
        "\n{runs} runs of {triangles} triangles on {size} x {size} pixels in {steps} steps; {:.5} returned under the fit.\n\n{}",
        mean(&here),
        table.markdown()
    ))
}

/// Mean difference in percent of `of`, in bold if its interval excludes 0.
fn told(less: &[f64], of: f64) -> String {
    let [low, high] = mean_interval(less);
    let text = format!("{:+.0} %", 100.0 * mean(less) / of);
    if low > 0.0 || high < 0.0 { format!("**{text}**") } else { text }
}
