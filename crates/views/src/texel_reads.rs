//! Texels as views read them.

use anyhow::ensure;
use rayon::prelude::*;
use softrast_mesh::{
    Mesh,
    vectors::{dot, normal},
};
use softrast_raster::Pinhole;

use crate::{PaintedView, Unwrapped, nearest_samples};

/// Pixels of the squares of all views at most, and of samples four times as many: larger squares are reduced.
const MOST_PIXELS: f64 = (1u64 << 23) as f64;
/// Samples along each side of a pixel.
const EACH: usize = 2;
/// The square of a view is this much larger than its mask.
const MARGIN: f64 = 1.04;
/// Views are added up in so many parts, whatever the number of threads.
const PARTS: usize = 4;
/// Steps between two texels that a place is rounded to.
const STEPS: f64 = 65535.0;

/// A place between four texels.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// The one above left.
    texel: u32,
    /// From the left texels to the right ones and from the upper to the lower ones, in [`STEPS`].
    right: u16,
    down: u16,
}

/// A pixel that counts.
#[derive(Debug)]
struct Pixel {
    samples: u8,
    /// Factor of the sum of the samples.
    weight: f32,
    /// Known colour, times the square root of its weight.
    known: [f32; 3],
}

/// A view: its pixels, and their samples one after the other.
#[derive(Debug)]
struct Seen {
    pixels: Vec<Pixel>,
    samples: Vec<Sample>,
}

/// Texels that views read, and the colours that they should read: the square of each view around its mask, as many pixels as the picture has there.
///
/// It is linear in the texels: a pixel is the mean of 2 × 2 samples, and each sample a mean of four texels of the nearest face. A [`ColourRenderer`](softrast_raster::ColourRenderer) with narrow softnesses reads the same of
/// [`Attributes::with_texture`](softrast_raster::Attributes::with_texture), from a mesh that may move; here the mesh stays, so where a view reads is found once.
pub struct TexelReads {
    size: usize,
    views: Vec<Seen>,
    sees_face: Vec<bool>,
}

/// Squared differences between what views read of a texture and what they should.
#[derive(Clone, Debug)]
pub struct TexelPull {
    /// Half their sum.
    pub half: f64,
    /// The gradient of that, by texels.
    pub gradient: Vec<f32>,
}

impl TexelReads {
    /// Reads of the nearest face at each sample of each view, of a mesh in any unit. A pixel counts as much as the view says, times the cosine between the surface
    /// and the direction to the camera to the power of `facing`.
    ///
    /// # Errors
    ///
    /// If a mask is empty or full, or no view sees the mesh.
    pub fn new(
        mesh: &Mesh,
        unwrapped: &Unwrapped,
        views: &[PaintedView],
        facing: f64,
    ) -> anyhow::Result<Self> {
        let extent = |view: &PaintedView| {
            view.view.square()?;
            Ok(view.view.mask.square().map_or(1.0, |[.., extent]| extent))
        };
        let extents = views.iter().map(extent).collect::<anyhow::Result<Vec<f64>>>()?;
        let pixels: f64 = extents.iter().map(|extent| (MARGIN * extent).powi(2)).sum();
        let scale = (MOST_PIXELS / pixels).sqrt().min(1.0);
        let mut sees_face = vec![false; mesh.faces().len()];
        let mut of_view =
            |view| Seen::new((mesh, unwrapped), view, [scale, facing], &mut sees_face);
        let views: Vec<Seen> = views.iter().map(&mut of_view).collect();
        let seen = views.iter().any(|view| !view.pixels.is_empty());
        ensure!(seen, "no camera has the mesh before it: is it where the pictures show it?");
        Ok(Self { size: unwrapped.size(), views, sees_face })
    }

    /// Whether some view shows a part of a face, for each.
    pub fn sees_face(&self) -> &[bool] {
        &self.sees_face
    }

    /// How much counts in all views together.
    pub fn counts(&self) -> f64 {
        let of = |pixel: &Pixel| f64::from(pixel.weight * f32::from(pixel.samples)).powi(2);
        self.views.iter().flat_map(|view| &view.pixels).map(of).sum()
    }

    /// Differences between what is read of texels and what is known, or black. `texels` are red, green and blue, row by row from the top. The sums are the
    /// same for any number of threads.
    ///
    /// # Panics
    ///
    /// If there are not three numbers for each texel.
    pub fn pull(&self, texels: &[f32], from_known: bool) -> TexelPull {
        assert_eq!(texels.len(), 3 * self.size * self.size, "numbers of texels");
        let each = self.views.len().div_ceil(PARTS).max(1);
        let of_part = |views: &[Seen]| {
            let mut sum = TexelPull { half: 0.0, gradient: vec![0.0; texels.len()] };
            views.iter().for_each(|view| view.pull(self.size, texels, from_known, &mut sum));
            sum
        };
        let parts: Vec<TexelPull> = self.views.par_chunks(each).map(of_part).collect();
        let mut parts = parts.into_iter();
        let mut all =
            parts.next().unwrap_or(TexelPull { half: 0.0, gradient: vec![0.0; texels.len()] });
        for part in parts {
            all.half += part.half;
            all.gradient.par_iter_mut().zip(&part.gradient).for_each(|(sum, x)| *sum += x);
        }
        all
    }
}

impl Seen {
    /// The square around the mask of a view, on about `scale` times as many pixels a side as the picture has there.
    fn new(
        (mesh, unwrapped): (&Mesh, &Unwrapped),
        view: &PaintedView,
        [scale, facing]: [f64; 2],
        sees_face: &mut [bool],
    ) -> Self {
        let [left, top, extent] = view.view.mask.square().unwrap_or([0.0, 0.0, 1.0]);
        let wide = (MARGIN * extent).ceil() + 2.0;
        let corner = [left, top].map(|x| (x + 0.5 * (extent - wide)).round());
        // Pixels of the picture themselves, where they are not too many.
        let side = (scale * wide).ceil().max(1.0) as usize;
        let square = [corner[0], corner[1], wide];
        let camera = view.view.camera.cropped(corner, [wide; 2], side);
        let cosines = cosines(mesh, &camera);
        let last = unwrapped.size() as f64 - 1.0;
        let empty = (Sample { texel: 0, right: 0, down: 0 }, u32::MAX);
        let nearest = nearest_samples(mesh, &camera, EACH, empty, |face, weights| {
            let place = |k: usize| {
                let at: f64 = (0..3).map(|i| weights[i] * unwrapped.corners()[face][i][k]).sum();
                (at - 0.5).clamp(0.0, last - 1e-6)
            };
            let [x, y] = [place(0), place(1)];
            let part = |x: f64| (STEPS * x.fract()).round() as u16;
            let texel = (y as usize * unwrapped.size() + x as usize) as u32;
            (Sample { texel, right: part(x), down: part(y) }, face as u32)
        });
        let [part, _] = view.part.part(square, side);
        let over_black = view.over_black().map(|channel| {
            let [levels, _] = channel.part(square, side);
            levels
        });
        let mut seen = Self { pixels: Vec::new(), samples: Vec::new() };
        for pixel in (0..side * side).filter(|&pixel| part[pixel] > 0.0) {
            let corner = pixel / side * EACH * EACH * side + pixel % side * EACH;
            let all = (0..EACH * EACH).map(|k| corner + k / EACH * EACH * side + k % EACH);
            let found = all.map(|k| nearest[k]).filter(|(depth, _)| depth.is_finite());
            let before = seen.samples.len();
            let mut cosine = 0.0;
            for (_, (sample, face)) in found {
                seen.samples.push(sample);
                cosine += cosines[face as usize];
                sees_face[face as usize] |= cosines[face as usize] > 0.0;
            }
            let samples = seen.samples.len() - before;
            // No face is there, or the backs of faces alone.
            if samples == 0 || cosine <= 0.0 {
                seen.samples.truncate(before);
                continue;
            }
            let share = samples as f32 / (EACH * EACH) as f32;
            let weight = (cosine / samples as f32).powf(0.5 * facing as f32);
            let known = over_black.each_ref().map(|levels| levels[pixel] as f32 * share * weight);
            let weight = weight * part[pixel] as f32 / (EACH * EACH) as f32;
            seen.pixels.push(Pixel { samples: samples as u8, weight, known });
        }
        seen
    }

    /// Adds half the squared differences, and their gradient.
    fn pull(&self, size: usize, texels: &[f32], from_known: bool, sum: &mut TexelPull) {
        let mut first = 0;
        for pixel in &self.pixels {
            let samples = &self.samples[first..first + usize::from(pixel.samples)];
            first += samples.len();
            let mut drawn = [0.0f32; 3];
            for sample in samples {
                for (texel, share) in sample.texels(size) {
                    (0..3).for_each(|k| drawn[k] += share * texels[3 * texel + k]);
                }
            }
            let known = if from_known { pixel.known } else { [0.0; 3] };
            let off = [0, 1, 2].map(|k| pixel.weight * drawn[k] - known[k]);
            sum.half += 0.5 * off.iter().map(|&x| f64::from(x * x)).sum::<f64>();
            let to = off.map(|x| x * pixel.weight);
            for sample in samples {
                for (texel, share) in sample.texels(size) {
                    (0..3).for_each(|k| sum.gradient[3 * texel + k] += share * to[k]);
                }
            }
        }
    }
}

impl Sample {
    /// Four texels and their shares.
    #[inline(always)]
    fn texels(&self, size: usize) -> [(usize, f32); 4] {
        let [right, down] = [self.right, self.down].map(|x| f32::from(x) * (1.0 / STEPS as f32));
        let (left, above, first) = (1.0 - right, 1.0 - down, self.texel as usize);
        [
            (first, left * above),
            (first + 1, right * above),
            (first + size, left * down),
            (first + size + 1, right * down),
        ]
    }
}

/// Cosines between faces and the directions from them to a camera; 0 where it sees them from behind.
fn cosines(mesh: &Mesh, camera: &Pinhole) -> Vec<f32> {
    let eye = camera.eye();
    let of = |[a, b, c]: [[f64; 3]; 3]| {
        let n = normal([a, b, c]);
        let to = [0, 1, 2].map(|k| eye[k] - (a[k] + b[k] + c[k]) / 3.0);
        let lengths = (dot(n, n) * dot(to, to)).sqrt();
        if lengths > 0.0 { (dot(n, to) / lengths).max(0.0) as f32 } else { 0.0 }
    };
    mesh.triangles().map(of).collect()
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;
    use crate::{Picture, View, coloured_pixels};

    /// A ball in colours, and two views of it: its texels are none of these colours.
    fn ball() -> (Mesh, Unwrapped, Vec<PaintedView>) {
        let ball = icosphere(3);
        let colours = ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.4 * x)).collect();
        let ball = ball.with_colours(colours).unwrap();
        let view = |eye: [f64; 3]| {
            let camera = Pinhole::look_at(eye, [0.0; 3], [0.0, 1.0, 0.1], 40.0, 32);
            let [colours @ .., mask] = coloured_pixels(&ball, &camera)
                .map(|levels| Picture::new(levels.iter().map(|&x| x as f32).collect(), 32));
            let (name, picture) = ("ball".into(), "ball.png".into());
            let opacity = mask.clone();
            let view = View { name, picture, mask, camera, distortion: None, off: 0.0 };
            PaintedView::new(view, colours, &opacity)
        };
        let views = [[0.0, 0.0, 4.0], [3.0, 1.0, 2.0]].map(view).into();
        let unwrapped = Unwrapped::of(&ball, 96).unwrap();
        (ball, unwrapped, views)
    }

    fn texels(count: usize) -> Vec<f32> {
        (0..count).map(|k| 0.5 + 0.4 * (1.3 * k as f32).sin()).collect()
    }

    #[test]
    fn the_gradient_is_that_of_the_squared_differences() {
        let (ball, unwrapped, views) = ball();
        let reads = TexelReads::new(&ball, &unwrapped, &views, 2.0).unwrap();
        let start = texels(3 * 96 * 96);
        let along: Vec<f32> = (0..start.len()).map(|k| (0.7 * k as f32).cos()).collect();
        let at = |by: f32| {
            let moved: Vec<f32> = start.iter().zip(&along).map(|(x, d)| x + by * d).collect();
            reads.pull(&moved, true)
        };
        let slope = (at(0.5).half - at(-0.5).half) / 1.0;
        let found: f64 = at(0.0).gradient.iter().zip(&along).map(|(a, b)| f64::from(a * b)).sum();
        assert!((slope - found).abs() < 1e-4 * slope.abs().max(1.0), "{slope} {found}");
    }

    #[test]
    fn faces_that_no_camera_sees_are_not_seen() {
        let (ball, unwrapped, views) = ball();
        let reads = TexelReads::new(&ball, &unwrapped, &views, 2.0).unwrap();
        for (triangle, seen) in ball.triangles().zip(reads.sees_face()) {
            let z = triangle.iter().map(|p| p[2]).sum::<f64>() / 3.0;
            assert!(!seen || z > -0.9, "{z}");
            assert!(*seen || z < 0.9, "{z}");
        }
        assert!(reads.counts() > 100.0);
    }

    #[test]
    fn no_view_of_the_mesh_is_an_error() {
        let (ball, _, views) = ball();
        let behind = ball.positions().iter().map(|p| [p[0], p[1], p[2] + 50.0]).collect();
        let behind = ball.with_positions(behind).unwrap();
        let unwrapped = Unwrapped::of(&behind, 96).unwrap();
        let error = TexelReads::new(&behind, &unwrapped, &views[..1], 2.0).err().unwrap();
        assert!(error.to_string().contains("no camera has the mesh before it"), "{error}");
    }
}
