use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use serde_json::Value;
use softrast_raster::{ImageSize, Pinhole};

use super::{
    Distortion,
    coefficients::Coefficients,
    fields::{json, read, typed},
};

/// Intrinsics of a camera in a file.
///
/// Focal lengths are `fl_x` and `fl_y`, `fx` and `fy`, the matrix `K`, or the field of view `camera_angle_x` in radians; the principal
/// point is `cx` and `cy`, else that of `K`, else the middle; the size of pictures is `w` and `h` or `width` and `height`. See [`Pinhole`]
/// for their definitions.
///
/// A calibration of OpenCV or ROS is also supported, in JSON or YAML: `camera_matrix` is its K, relative to the centre of the first pixel,
/// with `distortion_coefficients`, `image_width`, `image_height` and `distortion_model`.
///
/// A lens may have distortion: `k1` to `k6`, `p1` and `p2` of OpenCV, or its list `distortion_coefficients`; a fisheye has k1 to k4 and
/// `is_fisheye`, or a `camera_model` of this kind. Names of models are those of COLMAP.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Lens {
    #[serde(alias = "fx")]
    fl_x: Option<f64>,
    #[serde(alias = "fy")]
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    #[serde(rename = "K")]
    matrix: Option<[[f64; 3]; 3]>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    #[serde(alias = "width")]
    w: Option<f64>,
    #[serde(alias = "height")]
    h: Option<f64>,
    camera_model: Option<String>,
    #[serde(flatten)]
    coefficients: Coefficients,
}

/// Focal lengths relative to the shorter and the longer side of a picture: fields of view from 179 degrees down to a thousandth of one.
const FOCAL_LENGTHS: [f64; 2] = [0.01, 1e5];
/// Largest offset of the principal point, in longer sides: a picture may be a small crop of a large one.
const FARTHEST_CENTRE: f64 = 1e5;
/// Largest relative difference of `fx` and that of `K`: files hold few digits.
const ROUNDED: f64 = 1e-6;

impl Lens {
    /// The lens of a camera file: a `transforms.json`, a calibration of OpenCV or ROS in YAML or JSON, or a result file of this project.
    ///
    /// # Errors
    ///
    /// If the file is missing, is neither JSON nor such YAML, has a field of another type, or has no focal length.
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let (bytes, name) = read(path.as_ref())?;
        Self::parse(&bytes, &name)
    }

    /// The lens in the content of a camera file called `name`.
    ///
    /// # Errors
    ///
    /// The errors of [`Lens::load`], except those of reading.
    pub fn parse(bytes: &[u8], name: &str) -> anyhow::Result<Self> {
        let file = json(bytes, name)?;
        // Result files hold the camera one level down.
        let camera = if file["camera"].is_object() { &file["camera"] } else { &file };
        let lens = Self::of(camera).and_then(|lens| lens.angle_or_length().map(|()| lens));
        lens.with_context(|| name.to_owned())
    }

    /// The lens with the fields of an object.
    pub(super) fn of(object: &Value) -> anyhow::Result<Self> {
        typed(object)
    }

    /// A lens with this whole field of view along the shorter side of an image, in degrees above 0 and below 180, and square pixels.
    ///
    /// [`Lens::pinhole`] refuses other angles.
    pub fn of_fov(fov_deg: f64, size: ImageSize) -> Self {
        let focal = size.shorter() as f64 / (2.0 * (fov_deg / 2.0).to_radians().tan());
        Self { fl_x: Some(focal), ..Self::default() }
    }

    /// The camera with this lens for pictures of this size, at the origin, looking along z; and the distortion of the lens, if there is
    /// one. The camera is that of pictures after [`Picture::undistorted`](crate::Picture::undistorted).
    ///
    /// # Errors
    ///
    /// If it is for pictures of another size, is inconsistent, has a skew or no focal length, an implausible one for this size, or an
    /// unknown model.
    pub fn camera(&self, size: ImageSize) -> anyhow::Result<(Pinhole, Option<Distortion>)> {
        self.check_size(size)?;
        let distortion = self.coefficients.distortion(self.camera_model.as_deref())?;
        let pixels = [size.width as f64, size.height as f64];
        let centre = self.centre();
        let pinhole = Pinhole {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            translation: [0.0; 3],
            focal: self.focal(pixels)?,
            centre: [0, 1].map(|k| centre[k].unwrap_or(pixels[k] / 2.0)),
            size,
        };
        pinhole.check()?;
        check_sense(&pinhole)?;
        distortion.map_or(Ok(()), |distortion| distortion.check(&pinhole))?;
        Ok((pinhole, distortion))
    }

    /// The camera with this lens for undistorted pictures; see [`Lens::camera`].
    ///
    /// # Errors
    ///
    /// If the lens distorts, or for the reasons of [`Lens::camera`].
    pub fn pinhole(&self, size: ImageSize) -> anyhow::Result<Pinhole> {
        let (pinhole, distortion) = self.camera(size)?;
        ensure!(
            distortion.is_none(),
            "the lens distorts: take Lens::camera, and undistort the picture with Picture::undistorted"
        );
        Ok(pinhole)
    }

    /// Focal lengths in pixels, for pictures of this many along x and y.
    fn focal(&self, pixels: [f64; 2]) -> anyhow::Result<[f64; 2]> {
        self.angle_or_length()?;
        let of_matrix = self.matrix.as_ref().map(focal_of).transpose()?;
        if let Some(fx) = self.fl_x {
            let focal = [fx, self.fl_y.unwrap_or(fx)];
            if let Some(other) = of_matrix.filter(|other| {
                (0..2).any(|k| (other[k] - focal[k]).abs() > ROUNDED * focal[k].abs())
            }) {
                bail!("the focal lengths are {focal:?}, but {other:?} in K: leave one of them out");
            }
            return Ok(focal);
        }
        if let Some(focal) = of_matrix {
            return Ok(focal);
        }
        let length = |name: &str, angle: Option<f64>, pixels: f64| {
            let Some(angle) = angle else { return Ok(None) };
            ensure!(
                angle > 0.0 && angle < std::f64::consts::PI,
                "{name} is {angle}: it is the whole field of view in radians, between 0 and pi"
            );
            Ok(Some(pixels / (2.0 * (angle / 2.0).tan())))
        };
        let along_x = length("camera_angle_x", self.camera_angle_x, pixels[0])?;
        let along_y = length("camera_angle_y", self.camera_angle_y, pixels[1])?;
        // At least one exists. Pixels are square if the other does not.
        let either = along_x.or(along_y).unwrap_or_default();
        Ok([along_x.unwrap_or(either), along_y.unwrap_or(either)])
    }

    /// The principal point, as far as it is given.
    fn centre(&self) -> [Option<f64>; 2] {
        let of_matrix = |row: usize| self.matrix.map(|matrix| matrix[row][2]);
        [self.cx.or(of_matrix(0)), self.cy.or(of_matrix(1))]
    }

    fn angle_or_length(&self) -> anyhow::Result<()> {
        let told = [self.fl_x, self.camera_angle_x, self.camera_angle_y];
        ensure!(
            self.matrix.is_some() || told.iter().any(Option::is_some),
            "there is no focal length: name fx and fy in pixels (or fl_x and fl_y, K, camera_angle_x)"
        );
        Ok(())
    }

    fn check_size(&self, size: ImageSize) -> anyhow::Result<()> {
        let differs = |told: Option<f64>, found: usize| told.is_some_and(|x| x != found as f64);
        if differs(self.w, size.width) || differs(self.h, size.height) {
            let side = |told: Option<f64>| told.map_or("?".to_owned(), |x| x.to_string());
            bail!(
                "the camera is for pictures of {} x {} pixels, and this one has {size}: give the picture that the camera was \
                 calibrated for, or scale fx, fy, cx and cy",
                side(self.w),
                side(self.h)
            );
        }
        Ok(())
    }

    /// The lens of a frame that overrides some fields.
    pub(super) fn with(&self, frame: &Self) -> Self {
        // Focal lengths belong together, in whatever form they are given.
        let focal = if frame.angle_or_length().is_ok() { frame } else { self };
        let ([cx, cy], [own_cx, own_cy]) = (self.centre(), frame.centre());
        Self {
            cx: own_cx.or(cx),
            cy: own_cy.or(cy),
            w: frame.w.or(self.w),
            h: frame.h.or(self.h),
            camera_model: frame.camera_model.clone().or(self.camera_model.clone()),
            coefficients: frame.coefficients.or(&self.coefficients),
            ..focal.clone()
        }
    }
}

/// An error if a camera's numbers are positive but implausible: f32 could not distinguish pixels.
fn check_sense(camera: &Pinhole) -> anyhow::Result<()> {
    let size = camera.size;
    let (shorter, longer) = (size.shorter() as f64, size.width.max(size.height) as f64);
    let (shortest, longest) = (FOCAL_LENGTHS[0] * shorter, FOCAL_LENGTHS[1] * longer);
    for (name, focal) in ["fx", "fy"].into_iter().zip(camera.focal) {
        ensure!(
            (shortest..=longest).contains(&focal),
            "the focal length {name} is {focal:e} pixels, for a picture of {size} it must be from {shortest} to {longest:e}"
        );
    }
    for (name, centre) in ["cx", "cy"].into_iter().zip(camera.centre) {
        ensure!(
            centre.abs() <= FARTHEST_CENTRE * longer,
            "{name} is {centre:e} pixels, too far from a picture of {size}"
        );
    }
    Ok(())
}

/// The focal lengths of a camera matrix.
fn focal_of(&[[fx, skew, _], [below, fy, _], last]: &[[f64; 3]; 3]) -> anyhow::Result<[f64; 2]> {
    ensure!(
        [below, last[0], last[1], last[2]] == [0.0, 0.0, 0.0, 1.0],
        "K is no camera matrix: below its diagonal must be zeros, and its last row [0, 0, 1]; is it transposed?"
    );
    ensure!(
        skew.abs() <= 1e-9 * fx.abs(),
        "K has a skew of {skew}, which is not supported: rectify the picture"
    );
    Ok([fx, fy])
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const SIZE: ImageSize = ImageSize { height: 480, width: 640 };

    fn pinhole(lens: Value) -> Result<([f64; 2], [f64; 2]), String> {
        let found = Lens::of(&lens).and_then(|lens| lens.pinhole(SIZE));
        found.map(|camera| (camera.focal, camera.centre)).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn a_lens_is_told_in_many_ways() {
        let k = json!([[500.0, 0.0, 310.0], [0.0, 510.0, 250.0], [0.0, 0.0, 1.0]]);
        for (lens, expected) in [
            (json!({ "fx": 500.0 }), ([500.0, 500.0], [320.0, 240.0])),
            (json!({ "fl_x": 500.0, "fl_y": 510.0, "cy": 9.0 }), ([500.0, 510.0], [320.0, 9.0])),
            (json!({ "K": k }), ([500.0, 510.0], [310.0, 250.0])),
            (json!({ "K": k, "fx": 500.0, "fy": 510.0 }), ([500.0, 510.0], [310.0, 250.0])),
            (json!({ "K": k, "cx": 300.0, "w": 640 }), ([500.0, 510.0], [300.0, 250.0])),
            (
                json!({ "fx": 7, "distortion_params": [0, 0.0, [0]], "k1": 0 }),
                ([7.0; 2], [320.0, 240.0]),
            ),
        ] {
            assert_eq!(pinhole(lens.clone()), Ok(expected), "{lens}");
        }
        let right_angle = std::f64::consts::FRAC_PI_2;
        let (focal, _) = pinhole(json!({ "camera_angle_x": right_angle })).unwrap();
        assert!((0..2).all(|k| (focal[k] - 320.0).abs() < 1e-9), "{focal:?}");
    }

    #[test]
    fn what_contradicts_itself_or_is_not_supported_is_said() {
        let k = json!([[500.0, 0.0, 310.0], [0.0, 510.0, 250.0], [0.0, 0.0, 1.0]]);
        for (lens, part) in [
            (json!({ "K": k, "fx": 400.0 }), "in K"),
            (json!({ "camera_angle_x": 40.0 }), "radians"),
            (json!({ "fx": 500.0, "w": 7 }), "7 x ?"),
            (json!({ "fx": "a" }), "fx is \"a\", not a number"),
            (json!({ "fx": 500.0, "distortion_params": [0.0, -0.2] }), "the lens distorts"),
            (json!({ "fx": 500.0, "distortion": "yes" }), "distortion is \"yes\""),
            (json!({ "fx": 500.0, "distortion": { "k1": 0.0 } }), "no data in it"),
            (
                json!({ "fx": 500.0, "distortion": [0, 0, 0, 0, 0, 0, 0, 0, 0.5] }),
                "one of them 0.5",
            ),
            (json!({ "fx": 500.0, "distortion_params": [0, 0, 0, 0.5] }), "fourth coefficient 0.5"),
            (json!({ "fx": 500.0, "is_fisheye": true, "p1": 1 }), "k1 to k4 alone"),
            (
                json!({ "fx": 500.0, "camera_model": "FOV" }),
                "the camera model FOV is not supported",
            ),
            (json!({ "K": [[1.0]] }), "K"),
            (json!({ "fx": 5e-324 }), "fx is 5e-324 pixels"),
            (json!({ "fx": 1e300 }), "fx is 1e300 pixels"),
            (json!({ "fx": 500.0, "fy": 1e-3 }), "fy is 1e-3 pixels"),
            (json!({ "fx": 500.0, "cx": 1e40 }), "cx is 1e40 pixels"),
            (json!({ "camera_angle_x": 1e-300 }), "pixels, for a picture of 640 x 480"),
            (json!({}), "no focal length"),
        ] {
            let error = pinhole(lens.clone()).unwrap_err();
            assert!(error.contains(part) && error.lines().count() == 1, "{lens}: {error}");
        }
    }

    #[test]
    fn distortions_are_told_in_many_ways() {
        let found = |lens: Value| {
            let found = Lens::of(&lens).and_then(|lens| lens.camera(SIZE));
            found.map(|(_, distortion)| distortion).map_err(|error| format!("{error:#}"))
        };
        let rational = |k: [f64; 6], p: [f64; 2]| Ok(Some(Distortion::Rational { k, p }));
        let phone = rational([0.1, 0.2, 0.3, 0.0, 0.0, 0.0], [0.4, 0.5]);
        for lens in [
            json!({ "fx": 900, "k1": 0.1, "k2": 0.2, "k3": 0.3, "p1": 0.4, "p2": 0.5 }),
            json!({ "fx": 900, "distortion": [[0.1, 0.2, 0.4, 0.5, 0.3]] }),
            json!({ "fx": 900, "distortion_coefficients": { "rows": 1, "data": [0.1, 0.2, 0.4, 0.5, 0.3] } }),
            json!({ "fx": 900, "distortion_params": [0.1, 0.2, 0.3, 0, 0.4, 0.5], "camera_model": "OPENCV" }),
        ] {
            assert_eq!(found(lens.clone()), phone, "{lens}");
        }
        let whole =
            json!({ "fx": 900, "dist": [1, 2, 3, 4, 5, 6, 7, 8], "camera_model": "FULL_OPENCV" });
        assert_eq!(found(whole), rational([1.0, 2.0, 5.0, 6.0, 7.0, 8.0], [3.0, 4.0]));
        let fisheye = Ok(Some(Distortion::Fisheye { k: [0.1, 0.2, 0.0, 0.0] }));
        for lens in [
            json!({ "fx": 900, "camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": 0.2 }),
            json!({ "fx": 900, "is_fisheye": true, "distortion": [0.1, 0.2, 0, 0] }),
        ] {
            assert_eq!(found(lens.clone()), fisheye, "{lens}");
        }
        // A lens whose coefficients are all 0 is a pinhole, unless it is a fisheye.
        for lens in [
            json!({ "fx": 900, "k1": 0, "p2": 0.0, "camera_model": "SIMPLE_RADIAL" }),
            json!({ "fx": 900, "distortion": [0, 0, 0, 0, 0], "camera_model": "perspective" }),
            json!({ "fx": 900 }),
        ] {
            assert_eq!(found(lens.clone()), Ok(None), "{lens}");
        }
        let still = json!({ "fx": 900, "camera_model": "OPENCV_FISHEYE" });
        assert_eq!(found(still), Ok(Some(Distortion::Fisheye { k: [0.0; 4] })));
    }

    #[test]
    fn a_frame_goes_before_its_file() {
        let k = json!([[500.0, 0.0, 310.0], [0.0, 510.0, 250.0], [0.0, 0.0, 1.0]]);
        let merged = |file: Value, frame: Value| {
            let lens = Lens::of(&file).unwrap().with(&Lens::of(&frame).unwrap());
            let camera = lens.pinhole(SIZE).unwrap();
            (camera.focal, camera.centre)
        };
        let with_k = merged(json!({ "fx": 9.0, "cx": 1.0, "cy": 2.0 }), json!({ "K": k }));
        assert_eq!(with_k, ([500.0, 510.0], [310.0, 250.0]));
        let with_length = merged(json!({ "K": k }), json!({ "fl_x": 9.0 }));
        assert_eq!(with_length, ([9.0, 9.0], [310.0, 250.0]));
        assert_eq!(merged(json!({ "K": k }), json!({})), ([500.0, 510.0], [310.0, 250.0]));
    }
}
