//! Learns the schedule of a softness for finding a camera, by differentiating through whole runs; then solves with it.
//!
//! `cargo run --release -p softrast --example learn`

use softrast::{mesh::icosphere, prelude::*, tensor::NdArray};

fn main() -> anyhow::Result<()> {
    let ball = icosphere(1);
    let stretched = ball.positions().iter().map(|[x, y, z]| [*x, 0.7 * y, 0.4 * z + 0.3 * x]);
    let problem = PoseProblem::new(&Mesh::new(stretched.collect(), ball.faces().to_vec())?);
    let runs = SolveConfig { size: 32, steps: 30, learning_rate: 2.0 };

    let logistic = EdgeSoftness::new(Family::Logistic);
    let start = Method::new("start", ScheduledSoftness::decay(logistic, 0.3, 0.05));
    let estimator = Some(MetaGradient::default()); // exact, through all steps
    let config = LearnConfig { estimator, updates: 20, outer_rate: 0.2, ..LearnConfig::default() };
    let learned = learn::<_, NdArray, _>(problem.clone(), &start, &runs, &config, |record| {
        let validated = record.validation_loss.map(|loss| format!(", validation {loss:.3}"));
        println!("update {:2}{}", record.step, validated.unwrap_or_default());
        Ok(())
    })?;
    println!("scale from {:.3} to {:.4}", learned.scale_at(0.0, 32), learned.scale_at(1.0, 32));
    let file = std::env::temp_dir().join(format!("softrast-learned-{}.json", std::process::id()));
    learned.save(&file)?;
    println!("{}", file.display());

    let method = Method::new("learned", learned);
    let instances = [problem.instance(0)?];
    let end = minimize::<_, NdArray>(&problem, &instances, &method, &runs, |_, _| Ok(()))?;
    println!("IoU loss of the hard image: {:.4}", end.hard_loss[0]);
    Ok(())
}
