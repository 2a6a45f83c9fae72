//! Light that differs from view to view, so that it does not end in the shape and the colours.

use rayon::prelude::*;

/// Numbers of a light: factors of the spherical harmonics up to order 2.
const COUNT: usize = 9;
/// Decay of the mean of gradients, and of their squares.
const BETA: [f32; 2] = [0.7, 0.9];
/// A step of a factor at the usual rate.
const RATE: f32 = 0.01;
/// Squares of gradients below this count as this.
const LEAST: f32 = 1e-24;
/// Vertices that one thread takes at once.
const AT_ONCE: usize = 1 << 11;

/// The light of each view, and the state of its optimiser. A vertex with normal n shows its colour times `Σ cₖ Yₖ(n)`.
///
/// The mean of all lights has a factor of 1 in front of the constant, so that lights and colours cannot trade a common factor.
#[derive(Clone, Debug)]
pub(super) struct Lights {
    views: Vec<Light>,
}

#[derive(Clone, Debug)]
struct Light {
    factors: [f32; COUNT],
    means: [f32; COUNT],
    squares: [f32; COUNT],
}

/// Real spherical harmonics up to order 2 without their constants: all are of about one size.
#[inline(always)]
fn harmonics([x, y, z]: [f32; 3]) -> [f32; COUNT] {
    [1.0, x, y, z, x * y, y * z, 0.5 * (3.0 * z * z - 1.0), x * z, 0.5 * (x * x - y * y)]
}

impl Lights {
    /// Light of 1 from everywhere, in each of this many views.
    pub(super) fn new(views: usize) -> Self {
        let mut factors = [0.0; COUNT];
        factors[0] = 1.0;
        let light = Light { factors, means: [0.0; COUNT], squares: [0.0; COUNT] };
        Self { views: vec![light; views] }
    }

    /// How bright vertices with these normals `[vertices, 3]` are in a view, `[vertices]`; in the mean of all views if none is named.
    pub(super) fn on(&self, normals: &[f32], view: Option<usize>) -> Vec<f32> {
        let factors = view.map_or_else(|| self.mean(), |view| self.views[view].factors);
        let bright = |n: &[f32; 3]| {
            let (basis, mut sum) = (harmonics(*n), 0.0);
            for k in 0..COUNT {
                sum += factors[k] * basis[k];
            }
            sum
        };
        normals.as_chunks().0.par_iter().with_min_len(AT_ONCE).map(bright).collect()
    }

    /// Takes a step of the light of a view, given the gradient with respect to the brightness of vertices with these normals.
    pub(super) fn step(&mut self, view: usize, normals: &[f32], to_bright: &[f32], rate: f64) {
        let mut gradient = [0.0; COUNT];
        for (n, g) in normals.as_chunks().0.iter().zip(to_bright) {
            let basis = harmonics(*n);
            for k in 0..COUNT {
                gradient[k] += g * basis[k];
            }
        }
        let light = &mut self.views[view];
        for k in 0..COUNT {
            light.means[k] += (1.0 - BETA[0]) * (gradient[k] - light.means[k]);
            light.squares[k] += (1.0 - BETA[1]) * (gradient[k] * gradient[k] - light.squares[k]);
            let size = light.squares[k].max(LEAST).sqrt();
            light.factors[k] -= RATE * rate.sqrt() as f32 * light.means[k] / size;
        }
        let off = self.mean()[0] - 1.0;
        self.views.iter_mut().for_each(|light| light.factors[0] -= off);
    }

    fn mean(&self) -> [f32; COUNT] {
        let mut mean = [0.0; COUNT];
        for light in &self.views {
            for k in 0..COUNT {
                mean[k] += light.factors[k] / self.views.len() as f32;
            }
        }
        mean
    }
}
