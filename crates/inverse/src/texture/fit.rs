//! Texels by the gradient of what views show.

use std::sync::Arc;

use rayon::prelude::*;
use softrast_mesh::Mesh;
use softrast_raster::{
    Attributes, Background, ColourRenderer, HostBackend, Pinhole, Pinholes, Projected, project,
    vertices,
};
use softrast_tensor::{Autodiff, Tensor, TensorData, numbers};
use softrast_views::{Frame, PaintedView};

use super::{packing::Layout, texels::Texels};
use crate::paint::renderer;

type B = Autodiff<HostBackend>;

/// Pixels a side of the square of a view at most: larger squares are reduced.
const MOST_PIXELS: f64 = 1024.0;
/// Pixels that are drawn at once.
const AT_ONCE: usize = 1 << 21;
/// The square of a view is this much larger than its mask.
const MARGIN: f64 = 1.04;
/// Power of the cosine between a face and the direction to a camera by which a pixel counts: a view from the side shows a blurred surface, and one that
/// lies a little off shows another place.
const FACING: f32 = 2.0;
/// Weight of squared differences of neighbouring texels' changes, beside 1 for a pixel.
const SMOOTH: f32 = 0.03;
/// Weight of squared changes, so that every texel has an answer.
const STAYS: f32 = 1e-3;

/// Steps of conjugate gradients.
pub(super) const STEPS: usize = 12;

/// Views of a mesh on a texture.
pub(super) struct Fit {
    renderer: ColourRenderer,
    background: Background<B>,
    places: Tensor<B, 3>,
    entries: Arc<[[u32; 3]]>,
    groups: Vec<Group>,
    size: usize,
    /// How much counts in all views together.
    counts: f64,
}

/// Views that are drawn at once.
struct Group {
    seen: Projected<HostBackend>,
    /// How much each pixel counts, `[views, 1, size, size]`.
    part: Tensor<B, 4>,
    /// What is known, times that and the share of the faces, `[views, 3, size, size]`.
    known: Tensor<B, 4>,
}

impl Fit {
    /// Views of a mesh, in any unit.
    ///
    /// # Errors
    ///
    /// If a mask is empty, or no camera has the mesh before it.
    pub(super) fn new(mesh: &Mesh, layout: &Layout, views: &[PaintedView]) -> anyhow::Result<Self> {
        let squares = views.iter().map(|view| {
            view.view.square()?;
            Ok(view.view.mask.square().unwrap_or([0.0, 0.0, 1.0]))
        });
        let squares = squares.collect::<anyhow::Result<Vec<[f64; 3]>>>()?;
        let extent = squares.iter().map(|square| square[2]).fold(1.0, f64::max);
        let extent = (MARGIN * extent).ceil() + 2.0;
        // Pixels of the picture themselves, where they are not too many.
        let pixels = extent.min(MOST_PIXELS) as usize;
        let around = |square: &[f64; 3]| {
            let corner = [0, 1].map(|k| (square[k] + 0.5 * (square[2] - extent)).round());
            [corner[0], corner[1], extent]
        };
        let squares: Vec<[f64; 3]> = squares.iter().map(around).collect();
        let camera = |(view, square): (&PaintedView, &[f64; 3])| {
            view.view.camera.cropped([square[0], square[1]], [extent; 2], pixels)
        };
        let cameras: Vec<Pinhole> = views.iter().zip(&squares).map(camera).collect();
        let frame = Frame::of_cameras(mesh, &cameras);
        let mesh = frame.mesh(mesh);
        let cameras: Vec<Pinhole> = cameras.iter().map(|camera| frame.camera(camera)).collect();
        let device = Default::default();
        let corners = vertices::<HostBackend>(mesh.positions(), &device);
        let seen = project(corners.clone(), Pinholes::new(&cameras, &device));
        let depths = numbers(seen.tensor().narrow(2, 2, 1));
        let renderer = renderer(&mesh, &Arc::from(mesh.faces()), pixels, depths)?;
        let each = (AT_ONCE / (pixels * pixels)).max(1);
        let groups = views.chunks(each).zip(squares.chunks(each)).zip(cameras.chunks(each));
        let groups: Vec<Group> = groups
            .map(|((views, squares), cameras)| {
                let seen = project(corners.clone(), Pinholes::new(cameras, &device));
                Group::new(&renderer, &mesh, seen, (views, squares, cameras), pixels)
            })
            .collect();
        let counts = groups.iter().map(|group| {
            let part = group.part.clone().inner();
            numbers((part.clone() * part).sum())[0]
        });
        let places = layout.coordinates().into_iter().flatten().map(|x| x as f32).collect();
        let places = data::<3>(places, [1, 3 * mesh.faces().len(), 2]);
        let entries = (0..mesh.faces().len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]);
        Ok(Self {
            background: renderer.background(&[0.0; 3], &device),
            counts: counts.sum::<f64>().max(1e-6),
            renderer,
            places,
            entries: entries.collect(),
            groups,
            size: layout.size,
        })
    }

    /// Half the gradient of the squared differences to what is known, or to black, by texels; and that half of the differences.
    fn pull(&self, texels: &[f32], from_known: bool) -> (f64, Vec<f32>) {
        let mut sum = vec![0.0; texels.len()];
        let mut loss = 0.0;
        for group in &self.groups {
            let leaf = data::<3>(texels.to_vec(), [self.size, self.size, 3]).require_grad();
            let shown = Attributes::new(self.places.clone(), self.entries.clone());
            let shown = shown.with_texture(leaf.clone());
            let seen = Projected::from_inner(group.seen.clone());
            let image = self.renderer.image(seen, &shown, &self.background).narrow(1, 0, 3);
            let drawn = image.clone() * group.part.clone().expand(image.dims());
            let off = if from_known { drawn - group.known.clone() } else { drawn };
            let half = (off.clone() * off).sum() * 0.5;
            loss += numbers(half.clone().inner())[0];
            if let Some(gradient) = leaf.grad(&half.backward()) {
                let gradient = floats(gradient);
                sum.par_iter_mut().zip(&gradient).for_each(|(sum, x)| *sum += x);
            }
        }
        (loss, sum)
    }

    /// Changes texels towards the least squared differences to all views, as conjugate gradients do it. `told` is called with the steps taken and the mean
    /// squared difference; what it returns ends the descent, and the texels are as they were then.
    ///
    /// With A what views show of texels x, W how much pixels count and y what is known, `|W (A x - y)|² + SMOOTH Σ (dᵢ - dⱼ)² + STAYS Σ dᵢ²` is least, d the change of
    /// x: so what no view shows stays as it is beside what they show. The gradient of the op is Aᵀ, and the row sums of `Aᵀ W² A` precondition it.
    pub(super) fn run<E>(
        &self,
        texels: &mut Texels,
        mut told: impl FnMut(usize, f64) -> Result<(), E>,
    ) -> Result<(), E> {
        let ones = vec![1.0; texels.colours.len()];
        let beside = Beside { size: self.size, is_read: &texels.is_read };
        let (start, gradient) = self.pull(&texels.colours, true);
        let mut objective = start;
        let mean = |objective: f64| 2.0 * objective / (3.0 * self.counts);
        told(0, mean(objective))?;
        let (_, sums) = self.pull(&ones, false);
        let scale: Vec<f32> =
            sums.par_iter().map(|sum| (sum + 4.0 * SMOOTH + STAYS).recip()).collect();
        let read = |(k, x): (usize, f32)| if beside.is_read[k / 3] { x } else { 0.0 };
        let mut residual: Vec<f32> =
            gradient.into_par_iter().enumerate().map(|(k, x)| read((k, -x))).collect();
        let mut change = vec![0.0f32; residual.len()];
        let mut along: Vec<f32> = product(&residual, &scale);
        let mut size = dot(&residual, &along);
        let mut ended = Ok(());
        for step in 1..=STEPS {
            if size <= 0.0 {
                break;
            }
            let (_, mut pulled) = self.pull(&along, false);
            beside.add(&along, &mut pulled);
            let length = size / dot(&along, &pulled);
            if !length.is_finite() {
                break;
            }
            let by = length as f32;
            change.par_iter_mut().zip(&along).for_each(|(x, d)| *x += by * d);
            residual.par_iter_mut().zip(&pulled).for_each(|(x, d)| *x -= by * d);
            objective -= 0.5 * length * size;
            ended = told(step, mean(objective.max(0.0)));
            if ended.is_err() {
                break;
            }
            let next = product(&residual, &scale);
            let now = dot(&residual, &next);
            let kept = (now / size) as f32;
            along.par_iter_mut().zip(&next).for_each(|(d, x)| *d = x + kept * *d);
            size = now;
        }
        let change = texels.colours.par_iter_mut().zip(&change);
        change.for_each(|(x, change)| *x = (*x + change).clamp(0.0, 1.0));
        ended
    }
}

impl Group {
    fn new(
        renderer: &ColourRenderer,
        mesh: &Mesh,
        seen: Projected<HostBackend>,
        (views, squares, cameras): (&[PaintedView], &[[f64; 3]], &[Pinhole]),
        pixels: usize,
    ) -> Self {
        let count = views.len();
        let cosines: Vec<f32> =
            cameras.iter().flat_map(|camera| facing(mesh, camera)).map(|x| x as f32).collect();
        let cosines = data::<3>(cosines, [count, mesh.faces().len(), 1]).inner();
        let black = renderer.background::<HostBackend>(&[0.0], &Default::default());
        let image = renderer.image(seen.clone(), &Attributes::of_faces(cosines), &black);
        let (cosines, shares) =
            (floats(image.clone().narrow(1, 0, 1)), floats(image.narrow(1, 1, 1)));
        let (mut parts, mut known) = (Vec::new(), Vec::new());
        for (k, (view, &square)) in views.iter().zip(squares).enumerate() {
            let of_view = k * pixels * pixels..(k + 1) * pixels * pixels;
            let (shares, cosines) = (&shares[of_view.clone()], &cosines[of_view]);
            // By the square root, since differences are squared.
            let weigh = |k: usize| match shares[k] > 0.5 {
                true => (cosines[k] / shares[k]).clamp(0.0, 1.0).powf(0.5 * FACING),
                false => 0.0,
            };
            let weights: Vec<f32> = (0..pixels * pixels).map(weigh).collect();
            let [counts, _] = view.part.part(square, pixels);
            parts.extend(counts.iter().zip(&weights).map(|(&x, weight)| x as f32 * weight));
            for channel in &view.over_black {
                let [levels, _] = channel.part(square, pixels);
                let levels = levels.iter().zip(&weights).zip(shares);
                known.extend(levels.map(|((&x, weight), share)| x as f32 * weight * share));
            }
        }
        let part = data(parts, [count, 1, pixels, pixels]);
        Self { seen, part, known: data(known, [count, 3, pixels, pixels]) }
    }
}

/// Cosines between faces and the directions from them to a camera; 0 where it sees them from behind.
fn facing(mesh: &Mesh, camera: &Pinhole) -> Vec<f64> {
    let eye = camera.eye();
    let of = |[a, b, c]: [[f64; 3]; 3]| {
        let [u, v] = [b, c].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
        let n = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| u[i] * v[j] - u[j] * v[i]);
        let to = [0, 1, 2].map(|k| eye[k] - (a[k] + b[k] + c[k]) / 3.0);
        let dot = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| p[k] * q[k]).sum::<f64>();
        let lengths = (dot(n, n) * dot(to, to)).sqrt();
        if lengths > 0.0 { (dot(n, to) / lengths).max(0.0) } else { 0.0 }
    };
    mesh.triangles().map(of).collect()
}

/// Which texels have neighbours.
struct Beside<'a> {
    size: usize,
    is_read: &'a [bool],
}

impl Beside<'_> {
    /// Adds half the gradient of smoothness and of the size of changes; texels that are not read do not move.
    fn add(&self, change: &[f32], to: &mut [f32]) {
        let size = self.size;
        to.par_chunks_mut(3 * size).enumerate().for_each(|(y, row)| {
            for x in 0..size {
                let texel = y * size + x;
                if !self.is_read[texel] {
                    row[3 * x..3 * x + 3].fill(0.0);
                    continue;
                }
                let others = [
                    (x > 0).then(|| texel - 1),
                    (x + 1 < size).then(|| texel + 1),
                    (y > 0).then(|| texel - size),
                    (y + 1 < size).then(|| texel + size),
                ];
                for other in others.into_iter().flatten().filter(|&other| self.is_read[other]) {
                    for k in 0..3 {
                        row[3 * x + k] += SMOOTH * (change[3 * texel + k] - change[3 * other + k]);
                    }
                }
                (0..3).for_each(|k| row[3 * x + k] += STAYS * change[3 * texel + k]);
            }
        });
    }
}

fn product(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.par_iter().zip(b).map(|(a, b)| a * b).collect()
}

/// In 64 bits, part by part, so that the number of threads changes nothing.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let of = |(a, b): (&[f32], &[f32])| -> f64 {
        a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
    };
    let parts: Vec<f64> = a.par_chunks(1 << 14).zip(b.par_chunks(1 << 14)).map(of).collect();
    parts.into_iter().sum()
}

fn data<const D: usize>(numbers: Vec<f32>, shape: [usize; D]) -> Tensor<B, D> {
    Tensor::from_data(TensorData::new(numbers, shape), &Default::default())
}

/// Numbers of a tensor. Where others hold it too, reading it through its data goes number by number.
fn floats<const D: usize>(tensor: Tensor<HostBackend, D>) -> Vec<f32> {
    use softrast_raster::RasterBackend;
    let in_place =
        HostBackend::numbers(&tensor.clone().into_primitive().tensor()).map(<[f32]>::to_vec);
    in_place.unwrap_or_else(|| tensor.into_data().iter().collect())
}
