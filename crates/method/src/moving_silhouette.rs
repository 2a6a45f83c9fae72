use std::sync::Arc;

use burn::tensor::{DType, Tensor, TensorData, backend::Backend};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer, Silhouette};
use softrast_softness::{EdgeSoftness, Surrogate};

use crate::{Method, numbers, tensor};

/// A scale may fall by this factor before support and knots are chosen anew.
const STALE: f64 = 0.95;

/// Soft silhouettes of one mesh topology at a scale that moves, on as many pixels as the method asks
/// for at that scale.
#[derive(Clone, Debug)]
pub struct MovingSilhouette<B: Backend> {
    method: Method,
    rasterizer: Rasterizer,
    faces: Arc<[[u32; 3]]>,
    silhouette: Silhouette<EdgeSoftness>,
    /// The scale that support and knots of `silhouette` were chosen for.
    prepared: f64,
    table: Tensor<B, 2>,
    /// The scale of `table`.
    scale: f64,
    /// What the gradient is taken of, where that is not the image.
    felt: Option<Felt<B>>,
}

/// Silhouettes whose gradient stands for that of others, and their table.
#[derive(Clone, Debug)]
struct Felt<B: Backend> {
    silhouette: Silhouette<EdgeSoftness>,
    table: Tensor<B, 2>,
}

impl<B: RasterBackend> MovingSilhouette<B> {
    /// Silhouettes by `rasterizer`, whose size is that of the images that judge, of meshes with these
    /// faces, at first at `scale` (as [`Method::scale`] gives it).
    ///
    /// # Panics
    ///
    /// If there are no faces.
    pub fn new(
        method: &Method,
        rasterizer: Rasterizer,
        faces: &Arc<[[u32; 3]]>,
        scale: f64,
    ) -> Self {
        let phi = method.phi(scale);
        let silhouette = rasterizer.prepare(faces, method.softness(), &on_host::<B>(&phi));
        let silhouette = silhouette.sized(method.side(rasterizer.size, scale));
        let felt = method.surrogate(scale).map(|Surrogate { softness, phi }| {
            let silhouette = rasterizer.prepare(faces, softness, &on_host::<B>(&phi));
            Felt { table: table(&silhouette, phi), silhouette }
        });
        let table = table(&silhouette, phi);
        let (method, faces) = (method.clone(), faces.clone());
        Self { method, rasterizer, faces, silhouette, prepared: scale, table, scale, felt }
    }

    /// Makes the next images at `scale`, with as little work as that takes.
    pub fn turn_to(&mut self, scale: f64) {
        if self.scale == scale {
            return;
        }
        let (phi, surrogate) = (self.method.phi(scale), self.method.surrogate(scale));
        if !(STALE..=1.0).contains(&(scale / self.prepared)) {
            let prepared = |softness, phi: &[f64]| {
                self.rasterizer.prepare(&self.faces, softness, &on_host::<B>(phi))
            };
            self.silhouette = prepared(self.method.softness(), &phi);
            for (felt, to) in self.felt.iter_mut().zip(&surrogate) {
                felt.silhouette = prepared(to.softness, &to.phi);
            }
            self.prepared = scale;
        }
        for (felt, to) in self.felt.iter_mut().zip(surrogate) {
            felt.table = table(&felt.silhouette, to.phi);
        }
        let side = self.method.side(self.rasterizer.size, scale);
        self.silhouette = self.silhouette.clone().sized(side);
        (self.table, self.scale) = (table(&self.silhouette, phi), scale);
    }

    /// Coverage `[views, side, side]` of `vertices` `[views, vertices, 3]` (x and y in NDC, depth), with
    /// [`Method::side`] at the scale.
    ///
    /// Where the method has a surrogate, the gradient is that of
    /// [`Silhouette::coverage_with_surrogate`].
    pub fn image(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        let table = self.table.clone();
        let side = self.method.side(self.rasterizer.size, self.scale);
        match &self.felt {
            None => self.silhouette.coverage_by_table(vertices, table),
            Some(felt) => self.silhouette.coverage_with_surrogate(
                vertices,
                table,
                &felt.silhouette.clone().sized(side),
                felt.table.clone(),
            ),
        }
    }

    /// `image` as a picture, on as many pixels as the rasterizer has: if the image has fewer, each of them is
    /// repeated.
    pub fn picture(&self, image: Tensor<B, 3>) -> Tensor<B, 3> {
        let ([views, side, _], size) = (image.dims(), self.rasterizer.size);
        // Resolutions divide the size.
        let times = size / side;
        let blocks = image.reshape([views, side, 1, side, 1]);
        blocks.expand([views, side, times, side, times]).reshape([views, size, size])
    }
}

/// The table of parameters.
///
/// For a GPU it is computed on the CPU in f64: the GPU then gets it in one piece, instead of some
/// sixty small kernels over a few hundred numbers, and its curvature is not lost to rounding.
fn table<B: RasterBackend>(silhouette: &Silhouette<EdgeSoftness>, phi: Vec<f64>) -> Tensor<B, 2> {
    if B::ON_HOST {
        let shape = [phi.len()];
        return silhouette.table(tensor::<B, 1>(phi, shape));
    }
    let table = silhouette.table(on_host::<B>(&phi));
    let shape = table.dims();
    tensor(numbers(table), shape)
}

/// Parameters on the CPU; in f64 where they are not on the way to a CPU in f32 anyway.
fn on_host<B: RasterBackend>(phi: &[f64]) -> Tensor<HostBackend, 1> {
    let dtype = if B::ON_HOST { DType::F32 } else { DType::F64 };
    Tensor::from_data(TensorData::new(phi.to_vec(), [phi.len()]), (&Default::default(), dtype))
}

#[cfg(test)]
mod tests {
    use softrast_runner::{Resolution, Schedule, Settings};

    use super::*;
    use crate::Defaults;

    const SIZE: usize = 32;

    fn silhouette(scale: f64, resolution: Resolution) -> MovingSilhouette<HostBackend> {
        let defaults = Defaults {
            task: "none",
            schedule: Schedule::Decay,
            decay: [0.3, 0.002],
            fixed: 0.002,
            size: SIZE,
            backends: softrast_raster::compiled_backends!(),
        };
        let settings = Settings { resolution: Some(resolution), ..Settings::default() };
        let method = Method::new(&settings, &defaults).unwrap();
        MovingSilhouette::new(&method, method.rasterizer(SIZE), &[[0, 1, 2]].into(), scale)
    }

    fn triangle() -> Tensor<HostBackend, 3> {
        tensor(vec![-0.6, -0.5, 1.0, 0.7, -0.4, 1.0, 0.1, 0.8, 1.0], [1, 3, 3])
    }

    #[test]
    fn a_narrow_one_draws_all_pixels_to_the_bit() {
        let [auto, full] = [Resolution::Auto, Resolution::Full].map(|r| silhouette(0.002, r));
        assert_eq!(numbers(auto.image(triangle())), numbers(full.image(triangle())));
    }

    #[test]
    fn a_wide_one_draws_few_pixels_and_its_picture_repeats_them() {
        let [mut auto, mut full] = [Resolution::Auto, Resolution::Full].map(|r| silhouette(0.2, r));
        assert_eq!(auto.image(triangle()).dims(), [1, 8, 8]);
        let (few, picture) = (auto.image(triangle()), auto.picture(auto.image(triangle())));
        let [few, picture] = [few, picture].map(numbers);
        for y in 0..SIZE {
            for x in 0..SIZE {
                assert_eq!(picture[SIZE * y + x], few[8 * (y / 4) + x / 4]);
            }
        }
        // The pixels grow in number with the scale, whether or not the support is chosen anew.
        for (scale, side) in [(0.1, 16), (0.06, 32), (0.0599, 32)] {
            auto.turn_to(scale);
            full.turn_to(scale);
            assert_eq!(auto.image(triangle()).dims(), [1, side, side]);
        }
        assert_eq!(numbers(auto.image(triangle())), numbers(full.image(triangle())));
    }

    #[test]
    fn a_fixed_number_of_pixels_stays() {
        let mut fixed = silhouette(0.2, Resolution::Side(16));
        fixed.turn_to(0.002);
        assert_eq!(fixed.image(triangle()).dims(), [1, 16, 16]);
        let picture = fixed.picture(fixed.image(triangle()));
        assert_eq!(picture.dims(), [1, SIZE, SIZE]);
    }
}
