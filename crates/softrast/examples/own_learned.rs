//! A custom softness over whole runs: learns its schedule, saves it under a name, loads it and solves with it.
//!
//! `cargo run --release -p softrast --example own_learned`

use softrast::{mesh::fox, prelude::*, tensor::NdArray};

#[derive(Clone, Debug)]
struct Arctan;

impl Softness for Arctan {
    fn value<B: Backend, const D: usize>(&self, p: Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
        (x / p.exp().reshape([1; D])).atan() * std::f64::consts::FRAC_1_PI + 0.5
    }
}

impl NamedSoftness for Arctan {
    const NAME: &'static str = "arctan";
}

fn main() -> anyhow::Result<()> {
    let pose = PoseProblem::new(&fox().clustered(0.4).expect("faces are left"));
    let runs = SolveConfig { size: 16, steps: 20, learning_rate: 3.0 };
    let start = Method::new("start", ScheduledSoftness::decay(Arctan, 0.05, 0.002));
    let config = LearnConfig { updates: 6, outer_rate: 0.3, ..LearnConfig::default() };
    let learned = learn::<_, NdArray, _>(pose.clone(), &start, &runs, &config, |_| Ok(()))?;
    let file = std::env::temp_dir().join(format!("softrast-arctan-{}.json", std::process::id()));
    learned.save(&file)?;
    let learned = Method::new("learned", ScheduledSoftness::load_own(Arctan, &file)?);
    let poses = [0, 1, 2, 3].map(|seed| pose.instance(seed).expect("one for each seed"));
    for method in [start, learned] {
        let end = minimize::<_, NdArray>(&pose, &poses, &method, &runs, |_, _| Ok(()))?;
        println!("{}: IoU loss {:.4}", method.name, end.hard_loss.iter().sum::<f64>() / 4.0);
    }
    Ok(())
}
