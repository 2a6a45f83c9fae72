//! The error bound of pixels, for one random scene and softness.

use rand::{Rng, SeedableRng, rngs::StdRng};
use serde::{Deserialize, Serialize};
use softrast_raster::{Projected, RasterBackend, SoftRenderer, TConorm, reference};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{DType, NdArray, Tensor, TensorData, numbers, vector};

type Exact = NdArray<f64>;

const SIZE: usize = 12;

/// A scene, a softness and a tolerance.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToleranceCase {
    /// Seed of the triangles.
    pub scene: u64,
    /// Number of triangles.
    pub faces: usize,
    /// The softness.
    pub softness: EdgeSoftness,
    /// By name, as on the command line.
    pub t_conorm: String,
    /// Largest error of a pixel.
    pub tolerance: f64,
    /// Scales of the softness, in sequence, as logarithms to base 10, in NDC.
    pub widths: Vec<f64>,
    /// Index of another parameter and the amount added to it, before each image except the first.
    pub moves: Vec<(usize, f64)>,
}

/// Error of an image relative to that of every pixel-face pair.
#[derive(Clone, Copy, Debug)]
pub struct Deviation {
    /// The largest error of a pixel beyond rounding of distances.
    pub found: f64,
    /// The renderer's stated error.
    pub stated: f64,
}

impl Deviation {
    /// Whether no error exceeds the stated one.
    pub fn is_kept(&self) -> bool {
        self.found <= self.stated
    }
}

impl ToleranceCase {
    /// The case of a seed: over all families, T-conorms, scales from 1e-6 to 10 NDC and tolerances from 1e-2 to 1e-8.
    pub fn random(seed: u64) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let family = Family::ALL[random.random_range(0..Family::ALL.len())];
        let edge = if random.random() { EdgeSoftness::squared } else { EdgeSoftness::new };
        let softness = edge(family);
        let images = random.random_range(1..4);
        Self {
            scene: random.random(),
            faces: random.random_range(1..40),
            softness,
            t_conorm: t_conorm(&mut random).to_string(),
            tolerance: 10f64.powf(random.random_range(-8.0..-2.0)),
            widths: (0..images).map(|_| random.random_range(-6.0..1.0)).collect(),
            moves: (1..images)
                .map(|_| (random.random_range(0..3), random.random_range(-1.5..1.5)))
                .collect(),
        }
    }

    /// Draws all images of the case in f64, with one renderer.
    ///
    /// # Panics
    ///
    /// If the T-conorm has no such name, or there are no widths.
    pub fn deviations(&self) -> Vec<Deviation> {
        self.deviations_on::<Exact>(2e-14, 0.0)
    }

    /// Deviations in f32: vertices are rounded to f32 before the comparison. Rounding of cubics and sums is excluded: a relative error of
    /// the sum, about 32 roundings per term and one per added face, changes the coverage by `S dA/dS` times as much, which the T-conorm
    /// bounds.
    ///
    /// # Panics
    ///
    /// If the T-conorm has no such name, or there are no widths.
    pub fn deviations_in_f32(&self) -> Vec<Deviation> {
        let t_conorm: TConorm = self.t_conorm.parse().expect("a T-conorm");
        let of_sum = f64::from(f32::EPSILON) / 2.0 * (32.0 + self.faces as f64);
        self.deviations_on::<NdArray<f32>>(1e-6, of_sum * steepness(t_conorm).max(1.0))
    }

    /// `rounding` is that of a distance, absolute (NDC) and relative; `of_sums` that of a coverage.
    fn deviations_on<B: RasterBackend>(&self, rounding: f64, of_sums: f64) -> Vec<Deviation> {
        let t_conorm: TConorm = self.t_conorm.parse().expect("a T-conorm");
        let scale = |width: f64| {
            10f64.powf(if self.softness.scale_is_squared() { 2.0 * width } else { width })
        };
        let faces: Vec<[u32; 3]> =
            (0..self.faces as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        let mut renderer = SoftRenderer::new(&faces, SIZE, self.softness, scale(self.widths[0]))
            .with_tolerance(self.tolerance)
            .with_t_conorm(t_conorm);
        let mut deviations = Vec::new();
        for (k, &width) in self.widths.iter().enumerate() {
            let mut phi = renderer.phi().to_vec();
            if let Some(&(which, by)) = k.checked_sub(1).and_then(|k| self.moves.get(k)) {
                phi =
                    self.softness.with_scale_values(&phi, scale(width) / self.softness.scale(&phi));
                if let Some(others @ 1..) = phi.len().checked_sub(1) {
                    phi[1 + which % others] += by;
                }
            }
            renderer.set_phi(phi);
            let vertices = self.vertices(10f64.powf(width));
            let tensor = tensor::<B>(&vertices);
            let vertices = numbers(tensor.clone());
            let drawn = numbers(renderer.silhouette(Projected::new(tensor)));
            let ranges = Ranges { vertices: &vertices, faces: &faces, rounding };
            let found = drawn
                .iter()
                .zip(ranges.of_coverage(t_conorm, self.softness, renderer.phi()))
                .map(|(&drawn, [low, high])| match drawn {
                    // Written so that NaN is off.
                    _ if drawn >= low && drawn <= high => 0.0,
                    _ if drawn.is_nan() => f64::INFINITY,
                    _ => (low - drawn).max(drawn - high),
                })
                .fold(0.0, f64::max);
            let found = (found - of_sums).max(0.0);
            deviations.push(Deviation { found, stated: renderer.error_bound::<B>() });
        }
        deviations
    }

    /// Corners of the triangles. Half of the triangles pass a pixel's centre at a distance of about `width`.
    fn vertices(&self, width: f64) -> Vec<f64> {
        let mut random = StdRng::seed_from_u64(self.scene);
        let mut vertices = Vec::new();
        for _ in 0..self.faces {
            let mut number = |from: f64, to: f64| random.random_range(from..to);
            let near = number(0.0, 1.0) < 0.5;
            let (middle, radius) =
                ([number(-1.2, 1.2), number(-1.2, 1.2)], 10f64.powf(number(-2.0, 0.0)));
            let turn = number(0.0, std::f64::consts::TAU);
            let corner = |angle: f64| {
                [
                    middle[0] + radius * (turn + angle).cos(),
                    middle[1] + radius * (turn + angle).sin(),
                ]
            };
            let thirds = [0.0, number(0.1, 3.0), number(3.1, 6.2)];
            let mut corners = thirds.map(corner);
            let away = width * 10f64.powf(number(-3.0, 1.5)) * number(-1.0, 1.0).signum();
            let column = centre(number(0.0, SIZE as f64) as usize);
            let row = -centre(number(0.0, SIZE as f64) as usize);
            let depth = if number(0.0, 1.0) < 0.05 { -1.0 } else { 2.0 };
            if near {
                // An upright edge next to a column of pixels, or a corner next to one of them.
                let side = number(-1.0, 1.0).signum();
                let far = column + side * number(0.05, 2.0);
                corners = if number(0.0, 1.0) < 0.7 {
                    [[column + away, row - 0.7], [column + away, row + 0.9], [far, row]]
                } else {
                    [[column + away, row], [far, row - 0.3], [far, row + 0.4]]
                };
            }
            for [x, y] in corners {
                vertices.extend([x, y, depth]);
            }
        }
        vertices
    }
}

/// The largest `S dA/dS` of a coverage A with sum S.
fn steepness(t_conorm: TConorm) -> f64 {
    let moved = |k: i32| {
        let sum = f64::exp2(0.25 * f64::from(k));
        (t_conorm.coverage_of(1.001 * sum) - t_conorm.coverage_of(sum)) / 0.001
    };
    (-120..80).map(moved).fold(0.0, f64::max)
}

/// Ranges of coverage within rounding of distances.
struct Ranges<'a> {
    vertices: &'a [f64],
    faces: &'a [[u32; 3]],
    rounding: f64,
}

impl Ranges<'_> {
    /// The least and the largest coverage of each pixel.
    fn of_coverage(&self, t_conorm: TConorm, softness: EdgeSoftness, phi: &[f64]) -> Vec<[f64; 2]> {
        let count = self.faces.len();
        let places: Vec<f64> = (0..SIZE * SIZE)
            .flat_map(|pixel| [centre(pixel % SIZE), -centre(pixel / SIZE)])
            .collect();
        let places = TensorData::new(places, [SIZE * SIZE, 2]);
        let places = Tensor::<Exact, 2>::from_data(places, (&Default::default(), DType::F64));
        let distances =
            numbers(reference::signed_distance(tensor(self.vertices), self.faces, places));
        let terms = |shift: f64| {
            let moved: Vec<f64> =
                distances.iter().map(|d| d + shift * self.rounding * (1.0 + d.abs())).collect();
            let (value, _) =
                t_conorm.profile(&softness, vector::<Exact>(phi), vector::<Exact>(&moved));
            numbers(value)
        };
        let sides = [-1.0, 0.0, 1.0].map(terms);
        let seen = |face: &usize| {
            self.faces[*face].iter().all(|&v| self.vertices[3 * v as usize + 2] > 0.0)
        };
        let range = |pixel: usize| {
            let (mut low, mut high) = (0.0, 0.0);
            for face in (0..count).filter(seen) {
                let values = sides.each_ref().map(|side| side[pixel * count + face]);
                low += values.into_iter().fold(f64::INFINITY, f64::min);
                high += values.into_iter().fold(0.0, f64::max);
            }
            [low, high].map(|sum| t_conorm.coverage_of(sum))
        };
        (0..SIZE * SIZE).map(range).collect()
    }
}

/// The centre of a column in NDC.
fn centre(column: usize) -> f64 {
    (2 * column + 1) as f64 / SIZE as f64 - 1.0
}

fn tensor<B: RasterBackend>(vertices: &[f64]) -> Tensor<B, 3> {
    vector::<B>(vertices).reshape([1, vertices.len() as i64 / 3, 3])
}

fn t_conorm(random: &mut StdRng) -> TConorm {
    let mut power = |low: f64, high: f64| 2f64.powf(random.random_range(low..high));
    let [any, steep, frank] = [power(-2.0, 2.0), power(-1.0, 3.0), power(-3.0, 4.0)];
    match random.random_range(0..12) {
        0 => TConorm::Einstein,
        1 => TConorm::Hamacher(steep),
        2 => TConorm::Frank(frank),
        3 => TConorm::Yager(any),
        4 => TConorm::AczelAlsina(any),
        5 => TConorm::Dombi(any),
        6 => TConorm::SchweizerSklar(-any),
        _ => TConorm::Probabilistic,
    }
}
