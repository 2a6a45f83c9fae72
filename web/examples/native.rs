//! The same run on a computer, in one thread: `cargo run --release --example native -- SETTINGS.json-text`. It prints losses, angles and
//! milliseconds of each step as JSON, which the tests of the page compare with those of the browser.

use std::time::Instant;

use softrast_web::{PoseRun, Run, Settings};

fn main() -> anyhow::Result<()> {
    let settings = std::env::args().nth(1);
    let usual = r#"{"seed":0,"size":64,"steps":300,"softness":{"name":"preset"}}"#;
    let settings = Settings::parse(settings.as_deref().unwrap_or(usual))?;
    let mut run = PoseRun::new(&softrast_mesh::fox(), &settings)?;
    let (mut losses, mut angles, mut milliseconds) = (vec![], vec![], vec![]);
    loop {
        let clock = Instant::now();
        let Some(frame) = run.next()? else { break };
        milliseconds.push(clock.elapsed().as_secs_f64() * 1e3);
        losses.push(frame.loss);
        angles.push(frame.angle_deg);
    }
    let told =
        serde_json::json!({ "losses": losses, "angles": angles, "milliseconds": milliseconds });
    println!("{told}");
    Ok(())
}
