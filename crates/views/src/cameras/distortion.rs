use anyhow::ensure;
use serde_json::{Value, json};
use softrast_raster::Pinhole;

/// Radii sampled to determine where a lens folds the picture.
const RADII: usize = 2000;
/// Least unfolded radius of a valid lens, as a fraction of the shorter side.
const LEAST_UNFOLDED: f64 = 0.25;
/// Largest ratio of the radius of a corner to that of a pinhole, for a valid lens.
const MOST_STRETCHED: f64 = 10.0;

/// Lens distortion relative to a pinhole, in the models of OpenCV.
///
/// A point `(X, Y, Z)` before the camera has `x = X / Z`, `y = Y / Z` and `r² = x² + y²`. Its pixel is `(fx x' + cx, fy y' + cy)`.
///
/// ```
/// use softrast_views::{Distortion, Lens};
///
/// let barrel = Distortion::Rational { k: [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
/// assert!((barrel.bend([0.5, 0.0])[0] - 0.4875).abs() < 1e-12);
/// let lens = Lens::parse(br#"{"fl_x": 8.0, "k1": -0.1}"#, "lens.json")?;
/// assert_eq!(lens.camera(8.into())?.1, Some(barrel));
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// `x' = x q + 2 p1 x y + p2 (r² + 2 x²)` and `y' = y q + p1 (r² + 2 y²) + 2 p2 x y` with
    /// `q = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.
    Rational {
        /// k1 to k6.
        k: [f64; 6],
        /// p1 and p2.
        p: [f64; 2],
    },
    /// `x' = x θ' / r` and `y' = y θ' / r` with `θ = atan r` and `θ' = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`.
    Fisheye {
        /// k1 to k4.
        k: [f64; 4],
    },
}

impl Distortion {
    /// The coefficients as JSON, and the name of their model, as fields of a [`Lens`](crate::Lens).
    pub fn json(&self) -> Value {
        match self {
            Self::Rational { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] } => json!({
                "camera_model": "FULL_OPENCV",
                "k1": k1, "k2": k2, "k3": k3, "k4": k4, "k5": k5, "k6": k6, "p1": p1, "p2": p2,
            }),
            Self::Fisheye { k: [k1, k2, k3, k4] } => json!({
                "camera_model": "OPENCV_FISHEYE", "k1": k1, "k2": k2, "k3": k3, "k4": k4,
            }),
        }
    }

    /// `(x', y')` for `(x, y)`.
    pub fn bend(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let square = x * x + y * y;
        match self {
            Self::Rational { p: [p1, p2], .. } => {
                let q = self.ratio(square);
                [
                    x * q + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                    y * q + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
                ]
            }
            Self::Fisheye { .. } => [x, y].map(|x| x * self.ratio(square)),
        }
    }

    /// The radial factor `r' / r` for `r²`.
    fn ratio(&self, square: f64) -> f64 {
        let polynomial = |k: &[f64], x: f64| k.iter().rev().fold(0.0, |sum, k| (sum + k) * x);
        match self {
            Self::Rational { k, .. } => {
                (1.0 + polynomial(&k[..3], square)) / (1.0 + polynomial(&k[3..], square))
            }
            Self::Fisheye { k } => {
                let r = square.sqrt();
                let theta = r.atan();
                let per_radius = if r > 0.0 { theta / r } else { 1.0 };
                per_radius * (1.0 + polynomial(k, theta * theta))
            }
        }
    }

    /// The radius, at most `most`, up to which the distorted radius increases.
    fn unfolded(&self, most: f64) -> f64 {
        let radius = |step: usize| most * step as f64 / RADII as f64;
        let shown = |step: usize| radius(step) * self.ratio(radius(step).powi(2));
        let folds = (1..=RADII).find(|&step| {
            let (before, here) = (shown(step - 1), shown(step));
            !(here.is_finite() && here > before)
        });
        folds.map_or(most, |step| radius(step - 1))
    }

    /// An error if the distortion is implausible: it folds pictures near their middle, or stretches them.
    pub(super) fn check(&self, camera: &Pinhole) -> anyhow::Result<()> {
        let most = farthest(camera);
        let unfolded = self.unfolded(most);
        let ratio = self.ratio(unfolded * unfolded);
        let shown = unfolded * ratio * camera.focal[0].min(camera.focal[1]);
        let least = LEAST_UNFOLDED * camera.size.shorter() as f64;
        ensure!(
            unfolded >= most || shown >= least,
            "the coefficients of the lens fold the picture {shown:.1} pixels from its middle: no lens does that, so check their order and sign"
        );
        ensure!(
            ratio <= MOST_STRETCHED,
            "the coefficients of the lens stretch the picture {ratio:.1e} times: no lens does that, so check their order"
        );
        Ok(())
    }

    /// Positions of the pixels of an undistorted picture in the distorted one, in pixels from the corner of the first, row by row. `camera`
    /// is that of both, except for the lens.
    ///
    /// Beyond the radius where the lens folds the picture, the position is that of the fold in the same direction.
    pub(crate) fn sources(&self, camera: &Pinhole) -> impl Iterator<Item = [f64; 2]> {
        let Pinhole { focal, centre, size, .. } = *camera;
        let (lens, unfolded) = (*self, self.unfolded(farthest(camera)));
        let pixels = (0..size.pixels()).map(move |k| [k % size.width, k / size.width]);
        pixels.map(move |pixel| {
            let ray = [0, 1].map(|k| (pixel[k] as f64 + 0.5 - centre[k]) / focal[k]);
            let held = (unfolded / length(ray)).min(1.0);
            let bent = lens.bend(ray.map(|x| x * held));
            [0, 1].map(|k| focal[k] * bent[k] + centre[k])
        })
    }
}

/// The radius of the farthest corner of a picture.
fn farthest(camera: &Pinhole) -> f64 {
    let Pinhole { focal, centre, size, .. } = *camera;
    let [width, height] = [size.width as f64, size.height as f64];
    let corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]];
    let ray = |corner: [f64; 2]| [0, 1].map(|k| (corner[k] - centre[k]) / focal[k]);
    corners.map(|corner| length(ray(corner))).into_iter().fold(0.0, f64::max)
}

fn length([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PHONE: Distortion =
        Distortion::Rational { k: [-0.15, 0.04, 0.01, 0.02, -0.01, 0.003], p: [0.002, -0.0015] };
    const FISHEYE: Distortion = Distortion::Fisheye { k: [-0.02, 0.004, -0.001, 0.0002] };

    fn camera() -> Pinhole {
        let focal = [110.0, 120.0];
        Pinhole {
            focal,
            centre: [104.5, 71.75],
            ..Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, [150, 200])
        }
    }

    #[test]
    fn points_are_bent_as_opencv_bends_them() {
        let near = |found: [f64; 2], expected: [f64; 2]| {
            let close = (0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12);
            assert!(close, "{found:?} and {expected:?}");
        };
        // r² = .25, q = (1 - .0375 + .0025 + .00015625) / (1 + .005 - .000625 + .000046875).
        let q = 0.96515625 / 1.004421875;
        near(
            PHONE.bend([0.3, 0.4]),
            [
                0.3 * q + 2.0 * 0.002 * 0.12 - 0.0015 * (0.25 + 0.18),
                0.4 * q + 0.002 * (0.25 + 0.32) - 2.0 * 0.0015 * 0.12,
            ],
        );
        let theta = 0.5f64.atan();
        let t = theta * theta;
        let bent =
            theta * (1.0 - 0.02 * t + 0.004 * t * t - 0.001 * t.powi(3) + 0.0002 * t.powi(4));
        near(FISHEYE.bend([0.3, 0.4]), [0.6 * bent, 0.8 * bent]);
        near(FISHEYE.bend([0.0; 2]), [0.0; 2]);
        near(PHONE.bend([0.0; 2]), [0.0; 2]);
    }

    #[test]
    fn sources_follow_the_lens_and_stop_where_it_folds() {
        for lens in [PHONE, FISHEYE] {
            let places: Vec<[f64; 2]> = lens.sources(&camera()).collect();
            assert_eq!(places.len(), 200 * 150);
            let [x, y] = [(0.5 - 104.5) / 110.0, (0.5 - 71.75) / 120.0];
            let [x, y] = lens.bend([x, y]);
            assert_eq!(places[0], [110.0 * x + 104.5, 120.0 * y + 71.75]);
        }
        // r (1 - r²) is largest at r = .577.
        let folding = Distortion::Rational { k: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        let found = folding.unfolded(1.2);
        assert!((found - 1.0 / 3f64.sqrt()).abs() < 1e-3, "{found}");
        let camera = camera();
        let far =
            folding.sources(&camera).map(|[x, y]| ((x - 104.5) / 110.0).hypot((y - 71.75) / 120.0));
        let farthest = far.fold(0.0, f64::max);
        assert!((farthest - 2.0 / 27f64.sqrt()).abs() < 1e-6, "{farthest}");
        assert!(folding.check(&camera).is_ok() && PHONE.check(&camera).is_ok());
        let broken = |k1: f64| {
            let lens = Distortion::Rational { k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
            lens.check(&camera).unwrap_err().to_string()
        };
        assert!(broken(f64::MAX).contains("stretch") && broken(100.0).contains("stretch"));
        assert!(broken(-f64::MAX).contains("fold") && broken(-100.0).contains("fold"));
    }
}
