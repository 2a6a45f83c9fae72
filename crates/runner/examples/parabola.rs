//! The smallest task: a disc moves to its target by gradient descent on the squared distance.
//!
//! `cargo run --release -p softrast-runner --example parabola -- evaluate --runs 20`

use std::{process::ExitCode, time::Instant};

use rand::{Rng, SeedableRng, rngs::StdRng};
use softrast_runner::{
    Batch, Description, ErrorGroup, ExtraError, Measure, Pictures, Point, Progress, Resolution,
    Run, Settings, SoftnessChoice, Task, Variant, difference, rgb_from_gray,
};

#[allow(dead_code, reason = "the tests include this file as a module")]
fn main() -> ExitCode {
    softrast_runner::main::<Parabola>()
}

/// Flags that only this task has.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Radius of the disc, in units of half the image.
    #[arg(long, default_value_t = 0.4)]
    radius: f64,
}

/// The prepared task.
pub(crate) struct Parabola {
    softness: String,
    scale: f64,
    radius: f64,
    steps: usize,
    learning_rate: f64,
    size: usize,
}

/// A run succeeds when it ends at most this far from the target.
const NEAR: f64 = 0.02;

impl Task for Parabola {
    const NAME: &'static str = "parabola";
    const ABOUT: &'static str = "Moves a disc to its target by gradient descent";
    type Args = Args;

    fn prepare(settings: &Settings, args: &Args) -> anyhow::Result<Self> {
        let softness = match &settings.softness {
            None => "logistic".to_owned(),
            Some(SoftnessChoice::Named("logistic")) => "logistic".to_owned(),
            Some(SoftnessChoice::Named(name)) => {
                let message = format!("the parabola has no softness {name}, only logistic");
                return Err(softrast_runner::Error::Usage(message).into());
            }
            Some(SoftnessChoice::Learned(_)) => {
                let message = "there is no softness that was learned on the parabola".to_owned();
                return Err(softrast_runner::Error::Usage(message).into());
            }
            Some(SoftnessChoice::File(path)) => anyhow::bail!("cannot read the softness {path:?}"),
        };
        if settings.resolution.is_some_and(|asked| asked != Resolution::Full)
            || settings.tolerance.is_some()
        {
            let message = "the parabola draws exactly: leave out --resolution and --tolerance";
            return Err(softrast_runner::Error::Usage(message.into()).into());
        }
        let steps = match settings.variant {
            Variant::Original => 60,
            Variant::Transfer => 90,
        };
        Ok(Self {
            softness,
            scale: settings.scale.unwrap_or(0.02),
            radius: args.radius,
            steps: settings.steps.unwrap_or(steps),
            learning_rate: settings.learning_rate.unwrap_or(0.04),
            size: settings.size.unwrap_or(64),
        })
    }

    fn describe(&self) -> Description {
        let settings = serde_json::json!({
            "learning_rate": self.learning_rate,
            "scale": self.scale,
            "radius": self.radius,
        });
        Description {
            softness: self.softness.clone(),
            parameters: 1,
            backend: "none".into(),
            steps: self.steps,
            size: self.size,
            faces: 1,
            runs: 10,
            image_error: Measure { name: "IoU loss", unit: "" },
            parameter_error: Measure { name: "disc distance", unit: "half images" },
            extra: vec![ExtraError {
                group: ErrorGroup::Image,
                key: "square",
                measure: Measure { name: "mean squared error", unit: "" },
            }],
            success: format!("the disc ends within {NEAR} of its target"),
            settings: settings.as_object().cloned().unwrap_or_default(),
        }
    }

    fn batch_size(&self) -> usize {
        4
    }

    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>> {
        let mut discs: Vec<Disc> = batch.seeds.iter().map(|&seed| Disc::new(seed)).collect();
        let mut curves: Vec<Vec<Point>> = discs.iter().map(|d| vec![self.point(0, d)]).collect();
        let (target, start) = (self.draw(discs[0].target), self.draw(discs[0].position));
        let mut frames = vec![start.clone()];
        let mut step_seconds = Vec::new();
        for step in 1..=self.steps {
            let clock = Instant::now();
            discs.iter_mut().for_each(|disc| disc.descend(self.learning_rate));
            step_seconds.push(clock.elapsed().as_secs_f64());

            for (curve, disc) in curves.iter_mut().zip(&discs) {
                curve.push(self.point(step, disc));
            }
            let losses = discs.iter().map(|disc| disc.distance().powi(2));
            progress.step(step, losses.sum::<f64>() / discs.len() as f64)?;
            if batch.wants_frame(step, self.steps) {
                frames.push(self.draw(discs[0].position));
            }
        }
        let rgb = |values: &[f64]| rgb_from_gray(values, self.size, self.size);
        let result = self.draw(discs[0].position);
        let mut pictures = batch.pictures.then(|| Pictures {
            difference: difference(&rgb(&target), &rgb(&result)),
            target: rgb(&target),
            start: rgb(&start),
            result: rgb(&result),
            frames: frames.iter().map(|frame| rgb(frame)).collect(),
        });
        let runs = discs.iter().zip(curves).zip(&batch.seeds).map(|((disc, curve), &seed)| Run {
            seed,
            curve,
            success: disc.distance() <= NEAR,
            step_seconds: step_seconds.clone(),
            pictures: pictures.take(),
            warnings: Vec::new(),
        });
        Ok(runs.collect())
    }
}

impl Parabola {
    fn point(&self, step: usize, disc: &Disc) -> Point {
        let (target, now) = (self.draw(disc.target), self.draw(disc.position));
        let pairs = || target.iter().zip(&now);
        let both: f64 = pairs().map(|(a, b)| a.min(*b)).sum();
        let any: f64 = pairs().map(|(a, b)| a.max(*b)).sum();
        let square: f64 = pairs().map(|(a, b)| (a - b).powi(2)).sum();
        Point {
            step,
            loss: disc.distance().powi(2),
            image_error: 1.0 - both / any,
            parameter_error: disc.distance(),
            scale: self.scale,
            extra: vec![square / target.len() as f64],
        }
    }

    /// Coverage of every pixel, `[size * size]`.
    fn draw(&self, [x, y]: [f64; 2]) -> Vec<f64> {
        let centre = |k: usize| (2 * k + 1) as f64 / self.size as f64 - 1.0;
        let pixels = (0..self.size * self.size).map(|k| (k % self.size, k / self.size));
        let inside = pixels.map(|(c, r)| self.radius - (centre(c) - x).hypot(centre(r) - y));
        inside.map(|d| 1.0 / (1.0 + (-d / self.scale).exp())).collect()
    }
}

struct Disc {
    position: [f64; 2],
    target: [f64; 2],
}

impl Disc {
    fn new(seed: u64) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let mut place = || [(); 2].map(|()| random.random_range(-0.6..0.6));
        Self { position: place(), target: place() }
    }

    fn distance(&self) -> f64 {
        (self.position[0] - self.target[0]).hypot(self.position[1] - self.target[1])
    }

    fn descend(&mut self, learning_rate: f64) {
        for (x, target) in self.position.iter_mut().zip(self.target) {
            *x -= learning_rate * 2.0 * (*x - target);
        }
    }
}
