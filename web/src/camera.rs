use serde::Serialize;

/// Position and orientation of a camera, in world units with y up, for drawing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraView {
    /// Position.
    pub eye: [f64; 3],
    /// Viewing direction, of length 1.
    pub ahead: [f64; 3],
    /// Up direction of its picture, of length 1.
    pub up: [f64; 3],
}

impl CameraView {
    /// A camera that orbits the origin: distance in world units, elevation and azimuth in degrees.
    ///
    /// At azimuth 0 it is at -z; see [`softrast_raster::Orbit`].
    pub fn orbiting([distance, elevation_deg, azimuth_deg]: [f64; 3]) -> Self {
        let (sin_e, cos_e) = elevation_deg.to_radians().sin_cos();
        let (sin_a, cos_a) = azimuth_deg.to_radians().sin_cos();
        let ahead = [-cos_e * sin_a, -sin_e, cos_e * cos_a];
        // Beyond a pole the picture is turned by 180 degrees, as by `view_rotation`.
        let roll = if cos_e < 0.0 { -1.0 } else { 1.0 };
        let up = [-sin_e * sin_a, cos_e, sin_e * cos_a].map(|x| roll * x);
        Self { eye: ahead.map(|x| -distance * x), ahead, up }
    }

    /// Angle between the viewing directions of two cameras, in degrees.
    pub fn angle_deg(&self, other: &Self) -> f64 {
        let (a, b) = (self.eye, other.eye);
        let cross = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i]);
        let dot: f64 = (0..3).map(|k| a[k] * b[k]).sum();
        // Unlike an arc cosine, this is accurate near 0 and 180 degrees.
        cross.iter().map(|x| x * x).sum::<f64>().sqrt().atan2(dot).to_degrees()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_stands_where_its_angles_say() {
        let front = CameraView::orbiting([2.0, 0.0, 0.0]);
        assert_eq!(
            (front.eye, front.ahead, front.up),
            ([0.0, 0.0, -2.0], [-0.0, -0.0, 1.0], [-0.0, 1.0, 0.0])
        );
        let side = CameraView::orbiting([3.0, 0.0, 90.0]);
        assert!((side.eye[0] - 3.0).abs() < 1e-12);
        assert!((front.angle_deg(&side) - 90.0).abs() < 1e-9);
        assert!((front.angle_deg(&CameraView::orbiting([1.0, 30.0, 0.0])) - 30.0).abs() < 1e-9);
    }
}
