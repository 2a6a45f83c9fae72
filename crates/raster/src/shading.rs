//! Lighting of surfaces, in tensor ops: at vertices, or at pixels whose points and normals were drawn as attributes.

use softrast_tensor::{Backend, IndexingUpdateOp, Int, Tensor, TensorData};

/// A light source.
#[derive(Clone, Debug)]
pub enum Light<B: Backend> {
    /// A light at infinity.
    Directional {
        /// Direction towards the light, `[3]`, of any length but 0.
        towards: Tensor<B, 1>,
        /// Red, green and blue, `[3]`.
        colour: Tensor<B, 1>,
    },
    /// A point light, without attenuation.
    Point {
        /// Position, `[3]`, in world units.
        place: Tensor<B, 1>,
        /// Red, green and blue, `[3]`.
        colour: Tensor<B, 1>,
    },
}

impl<B: Backend> Light<B> {
    /// Unit vectors from points `[views, n, 3]` towards the light, 0 at the light itself, and its colour `[1, 1, 3]`.
    fn seen_from(&self, points: &Tensor<B, 3>) -> [Tensor<B, 3>; 2] {
        let (Self::Directional { towards: place, colour } | Self::Point { place, colour }) = self;
        let [place, colour] = [place, colour].map(|x| x.clone().reshape([1, 1, 3]));
        let towards = match self {
            Self::Directional { .. } => place.expand(points.dims()),
            Self::Point { .. } => place - points.clone(),
        };
        [unit(towards), colour]
    }
}

/// Unit normals of vertices, `[views, vertices, 3]`: the area-weighted means of the normals of adjacent faces. `vertices`
/// `[views, vertices, 3]` are in world units; `faces` are counterclockwise from outside.
///
/// The normal of a vertex without faces, or whose faces have no area or opposite normals, is 0.
///
/// # Panics
///
/// If there is no face, or a vertex number of a face is out of range.
pub fn vertex_normals<B: Backend>(vertices: Tensor<B, 3>, faces: &[[u32; 3]]) -> Tensor<B, 3> {
    let device = vertices.device();
    let numbers = [0, 1, 2].map(|k| {
        let numbers: Vec<i64> = faces.iter().map(|face| i64::from(face[k])).collect();
        let data = TensorData::new(numbers, [faces.len()]);
        Tensor::<B, 1, Int>::from_data(data, &device)
    });
    let [a, b, c] = numbers.each_ref().map(|numbers| vertices.clone().select(1, numbers.clone()));
    let normal = cross(b - a.clone(), c - a);
    let sums = numbers.into_iter().fold(vertices.zeros_like(), |sums, numbers| {
        sums.select_assign(1, numbers, normal.clone(), IndexingUpdateOp::Add)
    });
    unit(sums)
}

/// Diffuse light, `[views, n, 3]`: `Σ colour max(n · l, 0)` over the lights. Multiply it by the colour of the surface.
///
/// `points` and `normals` are `[views, n, 3]` in world units; normals are normalised to length 1.
///
/// # Panics
///
/// If there is no light, or shapes do not fit.
///
/// Source: Lambert 1760.
pub fn lambert<B: Backend>(
    points: Tensor<B, 3>,
    normals: Tensor<B, 3>,
    lights: &[Light<B>],
) -> Tensor<B, 3> {
    let normals = unit(normals);
    let of_light = |light: &Light<B>| {
        let [towards, colour] = light.seen_from(&points);
        positive(dot(&normals, &towards)) * colour
    };
    lights.iter().map(of_light).reduce(Tensor::add).expect("a light")
}

/// Specular highlights, `[views, n, 3]`: `Σ colour max(r · v, 0)^shininess` over the lights in front of a surface, where r is the direction
/// towards the light mirrored at the normal, and v the direction towards the eye.
///
/// `points` and `normals` are `[views, n, 3]` in world units, `eyes` `[1 or views, 3]`. Add them to [`lambert`].
///
/// # Panics
///
/// If there is no light, `shininess` is below 2 (a second derivative would be infinite), or shapes do not fit.
///
/// Source: Phong 1975.
pub fn phong<B: Backend>(
    points: Tensor<B, 3>,
    normals: Tensor<B, 3>,
    eyes: Tensor<B, 2>,
    lights: &[Light<B>],
    shininess: f64,
) -> Tensor<B, 3> {
    assert!(shininess >= 2.0, "a shininess of {shininess} is below 2");
    let normals = unit(normals);
    let eyes = eyes.unsqueeze_dim::<3>(1);
    let view = unit(eyes - points.clone());
    let of_light = |light: &Light<B>| {
        let [towards, colour] = light.seen_from(&points);
        let across = dot(&normals, &towards);
        let mirrored = normals.clone() * across.clone() * 2.0 - towards;
        let seen = positive(dot(&mirrored, &view)).mask_fill(across.lower_equal_elem(0.0), 0.0);
        #[allow(
            clippy::disallowed_methods,
            reason = "a shininess need not be known to more than an f32"
        )]
        let lobe = seen.powf_scalar(shininess);
        lobe * colour
    };
    lights.iter().map(of_light).reduce(Tensor::add).expect("a light")
}

/// Factors of the real spherical harmonics of order 0, 1 and 2: of 1; y, z, x; xy, yz, 3 z² - 1, xz, x² - y².
const HARMONICS: [f64; 9] = [
    0.282_094_791_773_878_14,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    1.092_548_430_592_079_1,
    1.092_548_430_592_079_1,
    0.315_391_565_252_520_05,
    1.092_548_430_592_079_1,
    0.546_274_215_296_039_6,
];

/// Environment light of low frequency, `[views, n, channels]`: `Σ cₖ Yₖ(n)` of the real spherical harmonics up to order 2, in the order 1;
/// y, z, x; xy, yz, 3 z² - 1, xz, x² - y². It may be negative.
///
/// `normals` are `[views, n, 3]`, normalised to length 1; `coefficients` are `[9, channels]`.
///
/// ```
/// use softrast_raster::{HostBackend, spherical_harmonics};
/// use softrast_tensor::{numbers, tensor};
///
/// // Light from above, on faces that look up and down.
/// let mut coefficients = vec![0.0; 9];
/// coefficients[1] = 1.0;
/// let normals = tensor::<HostBackend, 3>(vec![0.0, 1.0, 0.0, 0.0, -1.0, 0.0], [1, 2, 3]);
/// let light = numbers(spherical_harmonics(normals, tensor(coefficients, [9, 1])));
/// assert!((light[0] - 0.4886).abs() < 1e-4 && light[1] == -light[0]);
/// ```
///
/// # Panics
///
/// If shapes do not fit.
///
/// Source: Ramamoorthi and Hanrahan 2001.
pub fn spherical_harmonics<B: Backend>(
    normals: Tensor<B, 3>,
    coefficients: Tensor<B, 2>,
) -> Tensor<B, 3> {
    let [rows, _] = coefficients.dims();
    assert_eq!(rows, 9, "coefficients are [9, channels], found {:?}", coefficients.dims());
    let normals = unit(normals);
    let [x, y, z] = [0, 1, 2].map(|axis| normals.clone().narrow(2, axis, 1));
    let harmonics = [
        x.ones_like(),
        y.clone(),
        z.clone(),
        x.clone(),
        x.clone() * y.clone(),
        y.clone() * z.clone(),
        z.clone() * z.clone() * 3.0 - 1.0,
        x.clone() * z,
        x.clone() * x - y.clone() * y,
    ];
    let scaled = harmonics.into_iter().zip(HARMONICS).map(|(harmonic, factor)| harmonic * factor);
    Tensor::cat(scaled.collect(), 2).matmul(coefficients.unsqueeze())
}

/// Vectors `[views, n, 3]` normalised to length 1; those of length 0 stay.
fn unit<B: Backend>(vectors: Tensor<B, 3>) -> Tensor<B, 3> {
    // Squares of numbers far from 1 would leave the range of f32.
    let largest = vectors.clone().detach().abs().max_dim(2);
    let largest = largest.clone().mask_fill(largest.equal_elem(0.0), 1.0);
    let vectors = vectors / largest;
    let squared = dot(&vectors, &vectors);
    let none = squared.clone().equal_elem(0.0);
    vectors * squared.mask_fill(none, 1.0).sqrt().recip()
}

/// `max(x, 0)`, with the derivative 0 at 0.
fn positive<B: Backend>(x: Tensor<B, 3>) -> Tensor<B, 3> {
    let below = x.clone().lower_equal_elem(0.0);
    x.mask_fill(below, 0.0)
}

/// Dot products along the last axis: `[views, n, 1]`.
fn dot<B: Backend>(a: &Tensor<B, 3>, b: &Tensor<B, 3>) -> Tensor<B, 3> {
    (a.clone() * b.clone()).sum_dim(2)
}

fn cross<B: Backend>(a: Tensor<B, 3>, b: Tensor<B, 3>) -> Tensor<B, 3> {
    let axes = |x: Tensor<B, 3>| [0, 1, 2].map(|axis| x.clone().narrow(2, axis, 1));
    let ([ax, ay, az], [bx, by, bz]) = (axes(a), axes(b));
    let x = ay.clone() * bz.clone() - az.clone() * by.clone();
    let y = az * bx.clone() - ax.clone() * bz;
    Tensor::cat(vec![x, y, ax * by - ay * bx], 2)
}
