use anyhow::Context;
use serde::Deserialize;
use softrast_inverse::pose::PoseInstance;
use softrast_raster::Orbit;

/// The 24 pairs of start and target of the released runs.
///
/// # Errors
///
/// If the bundled file is broken.
pub fn released24() -> anyhow::Result<Vec<PoseInstance>> {
    /// Distance, elevation, azimuth and half the field of view of each camera.
    #[derive(Deserialize)]
    struct Released {
        targets: Vec<[f64; 4]>,
        starts: Vec<[f64; 4]>,
    }
    let text = include_str!("../instances/released24.json");
    let file: Released = serde_json::from_str(text).context("released24.json is broken")?;
    let camera = |[distance, elevation_deg, azimuth_deg, half_fov]: [f64; 4]| Orbit {
        distance,
        elevation_deg,
        azimuth_deg,
        fov_deg: 2.0 * half_fov,
    };
    let pairs = file.targets.into_iter().zip(file.starts);
    let pair = |(target, start)| PoseInstance { target: camera(target), start: camera(start) };
    Ok(pairs.map(pair).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_24_released_pairs_with_one_field_of_view() {
        let released = released24().unwrap();
        assert_eq!(released.len(), 24);
        assert!(released.iter().all(|instance| instance.target.fov_deg == 40.0));
        assert_eq!(released[0].start.distance, 8.061052322387695);
    }
}
