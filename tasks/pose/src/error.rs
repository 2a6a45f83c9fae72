/// Error of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseError {
    /// Great-circle angle between the directions of both cameras.
    pub angle_deg: f64,
    /// Absolute difference of the distances, in world units.
    pub distance: f64,
}

impl PoseError {
    /// The error of a pose at this distance, elevation and azimuth in the frame of the target
    /// camera, which is at `target_distance`.
    pub fn new([distance, elevation_deg, azimuth_deg]: [f64; 3], target_distance: f64) -> Self {
        let (sin_e, cos_e) = elevation_deg.to_radians().sin_cos();
        let (sin_a, cos_a) = azimuth_deg.to_radians().sin_cos();
        // Unlike an arc cosine, this is accurate near 0 and 180 degrees.
        let angle = (cos_e * sin_a).hypot(sin_e).atan2(cos_e * cos_a);
        Self { angle_deg: angle.to_degrees(), distance: (distance - target_distance).abs() }
    }

    /// The parameter error of the released curves: `|p - p*|² / 3` of the unit directions.
    ///
    /// Source: docs/notes.md, Losses and errors; the curves hold the sum over 24 instances.
    pub fn released(&self) -> f64 {
        (2.0 * (self.angle_deg.to_radians() / 2.0).sin()).powi(2) / 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angle(elevation_deg: f64, azimuth_deg: f64) -> f64 {
        PoseError::new([3.0, elevation_deg, azimuth_deg], 3.0).angle_deg
    }

    #[test]
    fn the_angle_is_that_on_the_sphere() {
        for (elevation, azimuth, expected) in
            [(0.0, 0.0, 0.0), (30.0, 0.0, 30.0), (0.0, -100.0, 100.0), (180.0, 180.0, 0.0)]
        {
            assert!((angle(elevation, azimuth) - expected).abs() < 1e-9, "{elevation} {azimuth}");
        }
        assert!((angle(45.0, 45.0) - 60.0).abs() < 1e-9);
    }

    #[test]
    fn the_released_measure_is_the_squared_chord_over_three() {
        let opposite = PoseError { angle_deg: 180.0, distance: 0.0 };
        assert!((opposite.released() - 4.0 / 3.0).abs() < 1e-12);
        let right = PoseError { angle_deg: 90.0, ..opposite };
        assert!((right.released() - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_distance_is_wrong_either_way() {
        assert_eq!(PoseError::new([2.0, 0.0, 0.0], 3.5).distance, 1.5);
        assert_eq!(PoseError::new([5.0, 0.0, 0.0], 3.5).distance, 1.5);
    }
}
