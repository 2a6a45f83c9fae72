//! The run of the page's test outside a browser: losses of its first steps, and time per step.
//!
//! `RAYON_NUM_THREADS=1 cargo run --release --example native > tests/native.json`

use std::time::Instant;

use softrast_web::{Backend, PoseRun, Run, Settings};

/// Steps whose losses are printed. After some 35, runs diverge by the rounding of sines and exponentials.
const TOLD: usize = 30;

fn main() -> anyhow::Result<()> {
    let settings = r#"{"seed":0,"size":64,"steps":300,"softness":{"name":"preset"}}"#;
    let mut run = PoseRun::<Backend>::new(&softrast_mesh::fox(), &Settings::parse(settings)?)?;
    let (mut losses, mut angle_deg) = (vec![], None);
    let clock = Instant::now();
    while let Some(frame) = run.next()? {
        losses.push(frame.loss);
        angle_deg = frame.angle_deg;
    }
    let milliseconds = clock.elapsed().as_secs_f64() * 1e3 / losses.len() as f64;
    eprintln!("{milliseconds:.2} ms a step");
    losses.truncate(TOLD + 1);
    println!("{}", serde_json::json!({ "losses": losses, "angle_deg": angle_deg }));
    Ok(())
}
