use softrast_tensor::{Backend, Tensor, tensor_on};

use crate::{
    Cameras, ImageSize, Orbit, RasterBackend,
    camera::{cross, dot, unit},
    small_product,
    view::sin_cos,
};

/// Deviation from a right angle, a unit length or the middle of an image that counts as zero.
const EXACT: f64 = 1e-6;
/// Largest deviation of entries of `R Rᵀ` from the identity for a rotation R: files hold few digits.
const ROUNDED: f64 = 1e-3;

/// A calibrated camera of any pose, in the convention of OpenCV.
///
/// Its axes are x right, y down and z ahead. It maps a world point p, with `c = R p + t = (x, y, z)`, to the pixel
/// `(fx x / z + cx, fy y / z + cy)`. The corner of the first pixel is (0, 0) and its centre (½, ½), as in instant-ngp, nerfstudio and
/// COLMAP; OpenCV's own calibration has (0, 0) at the centre of the first pixel, so add ½ to its cx and cy. There is no skew and no
/// distortion.
///
/// ```
/// # use softrast_tensor::NdArray;
/// use softrast_raster::{Pinhole, Pinholes, project, vertex_tensor};
///
/// let camera = Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, [150, 200]);
/// let device = Default::default();
/// let corners = vertex_tensor::<NdArray>(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], &device);
/// let seen = project(corners, Pinholes::new(&[camera], &device)).tensor(); // [1, 2, 3]
/// let x: Vec<f32> = seen.into_data().to_vec().unwrap();
/// assert!(x[0].abs() < 1e-6 && x[3] > 0.0, "the origin is in the middle, +x to the right");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// R, row by row, from world to camera axes.
    pub rotation: [[f64; 3]; 3],
    /// t, in world units.
    pub translation: [f64; 3],
    /// fx and fy, in pixels.
    pub focal: [f64; 2],
    /// cx and cy, in pixels.
    pub centre: [f64; 2],
    /// Height and width of the image.
    pub size: ImageSize,
}

/// A camera in the convention of PyTorch3D's `PerspectiveCameras`: for row vectors (`X R + T`), with axes x left, y up and z ahead; see
/// [`Pinhole::from_pytorch3d`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PyTorch3dCamera {
    /// R, row by row, from world to camera axes.
    pub r: [[f64; 3]; 3],
    /// T, in world units.
    pub t: [f64; 3],
    /// Focal lengths along x and y, in NDC: the shorter side of the image is 2.
    pub focal_length: [f64; 2],
    /// The principal point, x and y in NDC; 0 is the middle of the image.
    pub principal_point: [f64; 2],
}

/// Errors of a [`Pinhole`].
///
/// ```
/// use softrast_raster::{Pinhole, PinholeError};
///
/// let camera = Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 64);
/// assert_eq!(camera.check(), Ok(()));
/// let wrong = Pinhole { focal: [-1.0, 1.0], ..camera };
/// assert_eq!(wrong.check(), Err(PinholeError::NoFocalLength(-1.0, 1.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PinholeError {
    /// A number is infinite or NaN.
    #[error("the camera has a number that is not finite")]
    NotFinite,
    /// R is not orthonormal.
    #[error("R is no rotation: R Rᵀ is off the identity by {0:.2e}")]
    NoRotation(f64),
    /// R is a reflection.
    #[error(
        "R mirrors the world (its determinant is -1): the sign of one or of all its axes is wrong"
    )]
    Mirrors,
    /// A focal length is not positive.
    #[error("the focal lengths are {0} and {1} pixels: they must be positive")]
    NoFocalLength(f64, f64),
    /// The image is empty.
    #[error("the image has no pixels")]
    NoPixels,
}

impl Pinhole {
    /// A camera at `eye` with `target` in the middle of its image and `up` upwards; `fov_deg` is the whole field of view along the shorter
    /// side of the image.
    ///
    /// # Panics
    ///
    /// If `eye` is `target`, or the viewing direction is along `up`.
    pub fn look_at(
        eye: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
        fov_deg: f64,
        size: impl Into<ImageSize>,
    ) -> Self {
        let ahead = unit([0, 1, 2].map(|k| target[k] - eye[k]), "a camera stands at its target");
        let right = unit(cross(ahead, up), "a camera looks along its up");
        let rotation = [right, cross(ahead, right), ahead];
        Self::of_view(rotation, eye, fov_deg, size.into())
    }

    /// The camera of an orbit, for an image of this size.
    pub fn from_orbit(orbit: &Orbit, size: impl Into<ImageSize>) -> Self {
        let [elevation, azimuth] = [orbit.elevation_deg, orbit.azimuth_deg].map(f64::to_radians);
        let ((se, ce), (sa, ca)) = (elevation.sin_cos(), azimuth.sin_cos());
        // As in `view_rotation`: past a pole the view rolls by 180°.
        let roll = if ce < 0.0 { -1.0 } else { 1.0 };
        let rotation = [
            [-ca, 0.0, -sa].map(|x| roll * x),
            [se * sa, -ce, -se * ca].map(|x| roll * x),
            [-ce * sa, -se, ce * ca],
        ];
        let eye = rotation[2].map(|x| -orbit.distance * x);
        Self::of_view(rotation, eye, orbit.fov_deg, size.into())
    }

    /// The equivalent orbit, if there is one: the camera looks at the origin without a roll, its pixels are square and its principal point
    /// is in the middle, all to 1e-6.
    ///
    /// ```
    /// use softrast_raster::{Orbit, Pinhole};
    ///
    /// let orbit = Orbit { distance: 3.0, elevation_deg: 20.0, azimuth_deg: 30.0, fov_deg: 40.0 };
    /// let camera = Pinhole::from_orbit(&orbit, 64);
    /// assert!((camera.orbit().unwrap().azimuth_deg - 30.0).abs() < 1e-9);
    /// assert!(camera.cropped([0.0; 2], [32.0; 2], 64).orbit().is_none());
    /// ```
    pub fn orbit(&self) -> Option<Orbit> {
        let ([right, down, ahead], t) = (self.rotation, self.translation);
        let ([fx, fy], [cx, cy], size) = (self.focal, self.centre, self.size);
        let distance = t[2];
        let exact = [t[0] / distance, t[1] / distance, right[1], fx / fy - 1.0]
            .into_iter()
            .chain([2.0 * cx / size.width as f64 - 1.0, 2.0 * cy / size.height as f64 - 1.0]);
        let fits = distance > 0.0 && down[1] <= 0.0;
        let found = fits && exact.into_iter().all(|x| x.abs() < EXACT);
        found.then(|| Orbit {
            distance,
            elevation_deg: (-ahead[1]).clamp(-1.0, 1.0).asin().to_degrees(),
            // The row that determines the azimuth at a pole too.
            azimuth_deg: (-right[2]).atan2(-right[0]).to_degrees(),
            fov_deg: 2.0 * (size.shorter() as f64 / (2.0 * fx)).atan().to_degrees(),
        })
    }

    /// From a camera-to-world matrix with x right, y up and z behind, as in OpenGL, Blender, NeRF, instant-ngp and nerfstudio.
    pub fn from_opengl(
        camera_to_world: &[[f64; 4]; 4],
        focal: [f64; 2],
        centre: [f64; 2],
        size: impl Into<ImageSize>,
    ) -> Self {
        let axis = |k: usize, sign: f64| [0, 1, 2].map(|row| sign * camera_to_world[row][k]);
        let rotation = [axis(0, 1.0), axis(1, -1.0), axis(2, -1.0)];
        let eye = [0, 1, 2].map(|row| camera_to_world[row][3]);
        Self { rotation, translation: moved(rotation, eye), focal, centre, size: size.into() }
    }

    /// The camera-to-world matrix, as for [`Pinhole::from_opengl`].
    pub fn to_opengl(&self) -> [[f64; 4]; 4] {
        let ([x, y, z], eye) = (self.rotation, self.eye());
        let row = |k: usize| [x[k], -y[k], -z[k], eye[k]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// The camera of PyTorch3D's `PerspectiveCameras`, for an image of this size.
    ///
    /// ```
    /// use softrast_raster::{Pinhole, PyTorch3dCamera};
    ///
    /// let camera = Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 64);
    /// let theirs: PyTorch3dCamera = camera.to_pytorch3d();
    /// assert_eq!(theirs.t, [0.0, 0.0, 3.0]);
    /// assert_eq!(Pinhole::from_pytorch3d(&theirs, 64).translation, camera.translation);
    /// ```
    pub fn from_pytorch3d(camera: &PyTorch3dCamera, size: impl Into<ImageSize>) -> Self {
        let &PyTorch3dCamera { r, t, focal_length, principal_point } = camera;
        let size = size.into();
        let (half, signs) = (size.shorter() as f64 / 2.0, [-1.0, -1.0, 1.0]);
        let row = |k: usize| [0, 1, 2].map(|j| signs[k] * r[j][k]);
        let middle = [size.width, size.height].map(|pixels| pixels as f64 / 2.0);
        Self {
            rotation: [row(0), row(1), row(2)],
            translation: [0, 1, 2].map(|k| signs[k] * t[k]),
            focal: focal_length.map(|f| half * f),
            centre: [0, 1].map(|k| middle[k] - half * principal_point[k]),
            size,
        }
    }

    /// The arguments of PyTorch3D's `PerspectiveCameras` for this camera.
    pub fn to_pytorch3d(&self) -> PyTorch3dCamera {
        let (half, signs) = (self.size.shorter() as f64 / 2.0, [-1.0, -1.0, 1.0]);
        let row = |j: usize| [0, 1, 2].map(|k| signs[k] * self.rotation[k][j]);
        let middle = [self.size.width, self.size.height].map(|pixels| pixels as f64 / 2.0);
        PyTorch3dCamera {
            r: [row(0), row(1), row(2)],
            t: [0, 1, 2].map(|k| signs[k] * self.translation[k]),
            focal_length: self.focal.map(|f| f / half),
            principal_point: [0, 1].map(|k| (middle[k] - self.centre[k]) / half),
        }
    }

    /// Position of the camera, in world units.
    pub fn eye(&self) -> [f64; 3] {
        let (r, t) = (&self.rotation, &self.translation);
        [0, 1, 2].map(|k| -(0..3).map(|row| r[row][k] * t[row]).sum::<f64>())
    }

    /// Transforms a world point to camera axes: x right, y down, z ahead, in world units.
    ///
    /// ```
    /// use softrast_raster::Pinhole;
    ///
    /// let camera = Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 64);
    /// assert_eq!(camera.transform([0.0; 3]), [0.0, 0.0, 3.0]);
    /// ```
    pub fn transform(&self, point: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| dot(self.rotation[k], point) + self.translation[k])
    }

    /// Column and row of the pixel of a point, and its depth.
    pub fn pixel(&self, point: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.transform(point);
        let ([fx, fy], [cx, cy]) = (self.focal, self.centre);
        [fx * x / z + cx, fy * y / z + cy, z]
    }

    /// Checks the camera.
    ///
    /// # Errors
    ///
    /// If R is not a rotation to a thousandth, a focal length is not positive, there are no pixels, or a number is not finite.
    pub fn check(&self) -> Result<(), PinholeError> {
        let r = self.rotation;
        let numbers = r.as_flattened().iter().chain(&self.translation).chain(&self.focal);
        if !numbers.chain(&self.centre).all(|x| x.is_finite()) {
            return Err(PinholeError::NotFinite);
        }
        let product = (0..9).map(|k| (k / 3, k % 3));
        let off = product.map(|(i, j)| (dot(r[i], r[j]) - f64::from(u8::from(i == j))).abs());
        let off = off.fold(0.0, f64::max);
        if off > ROUNDED {
            return Err(PinholeError::NoRotation(off));
        }
        if dot(cross(r[0], r[1]), r[2]) < 0.0 {
            return Err(PinholeError::Mirrors);
        }
        let [fx, fy] = self.focal;
        if fx <= 0.0 || fy <= 0.0 {
            return Err(PinholeError::NoFocalLength(fx, fy));
        }
        if self.size.pixels() == 0 {
            return Err(PinholeError::NoPixels);
        }
        Ok(())
    }

    /// The camera of a rectangle of the image, scaled to another size: the corner of the rectangle and its extent are columns and rows in
    /// pixels.
    #[must_use]
    pub fn cropped(&self, corner: [f64; 2], extent: [f64; 2], size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        let gain = [size.width as f64 / extent[0], size.height as f64 / extent[1]];
        Self {
            focal: [0, 1].map(|k| gain[k] * self.focal[k]),
            centre: [0, 1].map(|k| gain[k] * (self.centre[k] - corner[k])),
            size,
            ..*self
        }
    }

    /// A camera at `eye` with its principal point in the middle.
    fn of_view(rotation: [[f64; 3]; 3], eye: [f64; 3], fov_deg: f64, size: ImageSize) -> Self {
        let focal = size.shorter() as f64 / (2.0 * (fov_deg / 2.0).to_radians().tan());
        let centre = [size.width, size.height].map(|pixels| pixels as f64 / 2.0);
        let translation = moved(rotation, eye);
        Self { rotation, translation, focal: [focal; 2], centre, size }
    }
}

/// t of a camera at `eye`.
fn moved(rotation: [[f64; 3]; 3], eye: [f64; 3]) -> [f64; 3] {
    rotation.map(|row| -dot(row, eye))
}

/// One [`Pinhole`] per view as tensors, all of them differentiable.
#[derive(Clone, Debug)]
pub struct Pinholes<B: Backend> {
    /// R of each view, `[views, 3, 3]`.
    pub rotation: Tensor<B, 3>,
    /// t of each view in world units, `[views, 3]`.
    pub translation: Tensor<B, 2>,
    /// fx, fy, cx and cy in pixels per view, or one camera for all views, `[1 or views, 4]`.
    pub intrinsics: Tensor<B, 2>,
    /// Height and width of all images.
    pub size: ImageSize,
}

impl<B: Backend> Pinholes<B> {
    /// The tensors of these cameras.
    ///
    /// # Panics
    ///
    /// If there is none, or their images differ in size.
    pub fn new(cameras: &[Pinhole], device: &B::Device) -> Self {
        let (views, size) = (cameras.len(), cameras[0].size);
        assert!(cameras.iter().all(|camera| camera.size == size), "cameras differ in image size");
        let rotation = cameras.iter().flat_map(|camera| camera.rotation.concat());
        let translation = cameras.iter().flat_map(|camera| camera.translation);
        let intrinsics = cameras.iter().flat_map(|camera| [camera.focal, camera.centre].concat());
        Self {
            rotation: tensor_on(rotation.collect(), [views, 3, 3], device),
            translation: tensor_on(translation.collect(), [views, 3], device),
            intrinsics: tensor_on(intrinsics.collect(), [views, 4], device),
            size,
        }
    }
}

impl<B: RasterBackend> Cameras<B> for Pinholes<B> {
    fn matrices(&self) -> Tensor<B, 3> {
        let Self { rotation, translation, intrinsics, size } = self;
        let [views, ..] = rotation.dims();
        let ([held, four], moves) = (intrinsics.dims(), translation.dims());
        assert_eq!(rotation.dims(), [views, 3, 3], "rotations must be [views, 3, 3]");
        assert_eq!(moves, [views, 3], "translations of {views} views are {moves:?}");
        assert!(
            four == 4 && (held == views || held == 1),
            "intrinsics of {views} views are [{held}, {four}]"
        );
        // To NDC: the shorter side is [-1, 1], and y goes up.
        let ([height, width], unit) =
            ([size.height, size.width].map(|x| x as f64), 2.0 / size.shorter() as f64);
        let device = rotation.device();
        let gain = tensor_on::<B, 2>(vec![unit, -unit, unit, -unit], [1, 4], &device);
        let shift = [0.0, 0.0, -width * unit / 2.0, height * unit / 2.0];
        let shift = tensor_on::<B, 2>(shift.to_vec(), [1, 4], &device);
        let ndc: Tensor<B, 3> = (intrinsics.clone() * gain + shift).unsqueeze_dim(2);
        let pose = Tensor::cat(vec![rotation.clone(), translation.clone().unsqueeze_dim(2)], 2);
        let ahead = pose.clone().narrow(1, 2, 1);
        let seen = pose.narrow(1, 0, 2) * ndc.clone().narrow(1, 0, 2)
            + ahead.clone() * ndc.narrow(1, 2, 2);
        Tensor::cat(vec![seen, ahead], 1)
    }
}

/// Rotates rotations `[views, 3, 3]` further: `exp([w]×) R`, by the angle |w| in radians around the axis w in camera axes.
///
/// `tangent` `[views, 3]` holds w. Gradients of any order exist at 0 too, so an optimiser can start at 0, and the parametrisation has no
/// pole. Rotations repeat beyond |w| = 2π, where the gradient along the sphere of w vanishes: before that, restart from the current
/// rotation.
///
/// # Panics
///
/// If the shapes do not fit.
pub fn rotate_by_tangent<B: RasterBackend>(
    tangent: Tensor<B, 2>,
    rotation: Tensor<B, 3>,
) -> Tensor<B, 3> {
    let [views, ..] = rotation.dims();
    assert_eq!(tangent.dims(), [views, 3], "tangents of {views} rotations");
    let square = (tangent.clone() * tangent.clone()).sum_dim(1); // [views, 1]
    // Near 0 by their series, whose next terms are below 1e-17; elsewhere in closed form, with an argument that avoids division by 0.
    let near = square.clone().lower_elem(SERIES);
    let series = |c: [f64; 4]| {
        ((square.clone() * c[3] + c[2]) * square.clone() + c[1]) * square.clone() + c[0]
    };
    let safe = square.clone().mask_fill(near.clone(), 1.0);
    let angle = safe.clone().sqrt();
    let [sin, cos] = sin_cos(angle.clone());
    let sinc = sin / angle;
    let versine = (cos.neg() + 1.0) / safe;
    let sinc = sinc.mask_where(near.clone(), series([1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0]));
    let versine = versine.mask_where(near, series([0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0]));

    let w = |k: usize| tangent.clone().narrow(1, k, 1);
    let zero = || w(0) * 0.0;
    let skew = vec![zero(), w(2).neg(), w(1), w(2), zero(), w(0).neg(), w(1).neg(), w(0), zero()];
    let skew = Tensor::cat(skew, 1).reshape([views, 3, 3]);
    let once = small_product(skew.clone(), rotation.clone());
    let twice = small_product(skew, once.clone());
    rotation + once * sinc.unsqueeze_dim(2) + twice * versine.unsqueeze_dim(2)
}

/// Squared angles below which series are used for sine and cosine.
const SERIES: f64 = 1e-3;
