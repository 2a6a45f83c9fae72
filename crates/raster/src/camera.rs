use softrast_tensor::{Backend, Tensor, numbers, tensor_on};

/// A viewing direction, or an up vector across it, of at most this length has no direction, in world units.
const SHORTEST: f64 = 1e-12;

/// A camera that looks at the origin, with y up.
///
/// ```
/// # use softrast_tensor::NdArray;
/// use softrast_raster::Orbit;
///
/// let front = Orbit { distance: 3.0, elevation_deg: 0.0, azimuth_deg: 0.0, fov_deg: 40.0 };
/// let side = Orbit { azimuth_deg: 90.0, ..front };
/// let cameras = Orbit::tensors::<NdArray>(&[front, side], &Default::default()); // [2, 4]
/// assert_eq!(Orbit::from_tensor(cameras), [front, side]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Distance from the origin, in world units.
    pub distance: f64,
    /// Angle above the horizontal plane.
    pub elevation_deg: f64,
    /// Angle around the vertical axis: at 0 the camera is at -z with +x on its left, at 90 at +x.
    pub azimuth_deg: f64,
    /// Whole field of view along the shorter side of the image; below 180.
    pub fov_deg: f64,
}

impl Orbit {
    /// This camera and others of the same elevation, evenly spaced around the vertical axis: `views` in total.
    ///
    /// ```
    /// use softrast_raster::Orbit;
    ///
    /// let front = Orbit { distance: 3.0, elevation_deg: 0.0, azimuth_deg: 0.0, fov_deg: 40.0 };
    /// let azimuths: Vec<f64> = front.around(4).iter().map(|camera| camera.azimuth_deg).collect();
    /// assert_eq!(azimuths, [0.0, 90.0, 180.0, 270.0]);
    /// ```
    pub fn around(&self, views: usize) -> Vec<Self> {
        let azimuth = |k: usize| self.azimuth_deg + 360.0 * k as f64 / views as f64;
        (0..views).map(|k| Self { azimuth_deg: azimuth(k), ..*self }).collect()
    }

    /// The camera as a tensor for [`project`](crate::project), `[1, 4]`.
    pub fn tensor<B: Backend>(&self, device: &B::Device) -> Tensor<B, 2> {
        Self::tensors(std::slice::from_ref(self), device)
    }

    /// One camera per view as a tensor, `[views, 4]`.
    pub fn tensors<B: Backend>(cameras: &[Self], device: &B::Device) -> Tensor<B, 2> {
        tensor_on(
            cameras.iter().flat_map(|camera| camera.numbers()).collect(),
            [cameras.len(), 4],
            device,
        )
    }

    /// The cameras of a tensor `[views, 4]`.
    ///
    /// # Panics
    ///
    /// If the tensor has another shape.
    pub fn from_tensor<B: Backend>(cameras: Tensor<B, 2>) -> Vec<Self> {
        let [_, four] = cameras.dims();
        assert_eq!(four, 4, "orbits must be [views, 4], found {:?}", cameras.dims());
        let of = |c: &[f64]| Self {
            distance: c[0],
            elevation_deg: c[1],
            azimuth_deg: c[2],
            fov_deg: c[3],
        };
        numbers(cameras).chunks(4).map(of).collect()
    }

    fn numbers(&self) -> [f64; 4] {
        [self.distance, self.elevation_deg, self.azimuth_deg, self.fov_deg]
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

/// `a / |a|`; panics with the message `otherwise` if `a` has no direction.
pub(crate) fn unit(a: [f64; 3], otherwise: &str) -> [f64; 3] {
    let length = dot(a, a).sqrt();
    assert!(length > SHORTEST, "{otherwise}");
    a.map(|x| x / length)
}
