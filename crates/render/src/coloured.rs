//! The colour op on the program's backend.

use std::{array, sync::Arc, time::Instant};

use softrast_raster::{
    Attributes, Background, ColourRenderer, Light, NEAR, Projected, RasterBackend, Weighting,
    lambert, project, vertex_normals, view_rotation,
};
use softrast_softness::{DepthSoftness, Family};
use softrast_tensor::{Tensor, numbers};

use crate::{
    fused::milliseconds,
    paint::Colour,
    scene::{Scene, Step},
};

/// Smallest scale of the depth softness relative to the distance between the planes: 32-bit floats hardly resolve nearer depths.
const LEAST_DEPTH: f64 = 1e-5;
/// Distance of the depth planes from the mesh, as a fraction of the farthest depth.
const BEYOND: f64 = 1e-3;
/// Light on a surface seen edge-on; one seen face-on has 1.
const AMBIENT: f64 = 0.3;

/// State shared by all steps.
pub(crate) struct Coloured<B: RasterBackend> {
    renderer: ColourRenderer,
    backgrounds: [Background<B>; 2],
    faces: Arc<[[u32; 3]]>,
    vertices: Tensor<B, 3>,
    orbits: Tensor<B, 2>,
    colours: Attributes<B>,
    shade: bool,
    /// Pixels along each side of the image, and samples along each side of a pixel.
    sides: [usize; 2],
}

impl<B: RasterBackend> Coloured<B> {
    pub(crate) fn new(scene: &Scene, colour: &Colour) -> Self {
        let (vertices, orbits) = (scene.vertices::<B>(), scene.orbits::<B>());
        let depths = project(vertices.clone(), orbits.clone()).tensor().narrow(2, 2, 1);
        let renderer = renderer(scene, colour, &numbers(depths));
        // Light has one channel, colours have three; both have a black background.
        let backgrounds = [3, 1].map(|n| renderer.background(&vec![0.0; n], &Default::default()));
        Self {
            renderer,
            backgrounds,
            faces: scene.faces.clone(),
            vertices,
            orbits,
            colours: colour.paint.attributes(&scene.faces),
            shade: colour.shade,
            sides: [scene.size, colour.samples],
        }
    }

    /// Draws all views once.
    pub(crate) fn step(&self) -> Step {
        let start = Instant::now();
        let seen = project(self.vertices.clone(), self.orbits.clone()).tensor();
        let views = seen.dims()[0];
        // One view after the other, because all samples of all views take much memory.
        let images =
            (0..views).map(|view| self.view(Projected::new(seen.clone().narrow(0, view, 1)), view));
        let (images, shares): (Vec<_>, Vec<_>) = images.unzip();
        let mean_alpha = shares.iter().sum::<f64>() / views as f64;
        let forward_ms = milliseconds::<B>(start);
        Step { image: images.concat(), mean_alpha, loss: None, forward_ms, backward_ms: None }
    }

    /// Red, green and blue `[3, size, size]` on white, and the mean coverage of the faces.
    fn view(&self, seen: Projected<B>, view: usize) -> (Vec<f64>, f64) {
        let [of_colours, of_light] = &self.backgrounds;
        let drawn = numbers(self.renderer.image(seen.clone(), &self.colours, of_colours));
        let light = self.shade.then(|| {
            let light = Attributes::of_vertices(self.light(view), &self.faces);
            numbers(self.renderer.image(seen, &light, of_light))
        });
        let [size, samples] = self.sides;
        let (width, part) = (size * samples, 1.0 / (samples * samples) as f64);
        let [red, green, blue, shares] = array::from_fn(|k| &drawn[k * width * width..]);
        let mut image = vec![0.0; 3 * size * size];
        let mut covered = 0.0;
        for at in 0..width * width {
            let share = shares[at];
            covered += part * share;
            // Both have a black background, so both contain the coverage of the faces.
            let lit = light.as_ref().map_or(1.0, |light| light[at] / share.max(f64::MIN_POSITIVE));
            let pixel = at / width / samples * size + at % width / samples;
            for (k, channel) in [red, green, blue].iter().enumerate() {
                image[k * size * size + pixel] += part * (channel[at] * lit + 1.0 - share);
            }
        }
        (image, covered / (size * size) as f64)
    }

    /// Light on the vertices, `[1, vertices, 1]`, from the position of the camera. Both sides of a surface are lit.
    fn light(&self, view: usize) -> Tensor<B, 3> {
        let orbit = self.orbits.clone().narrow(0, view, 1);
        let [distance, elevation, azimuth] =
            [0, 1, 2].map(|k| orbit.clone().narrow(1, k, 1).reshape([1]));
        let ahead = view_rotation(elevation, azimuth).narrow(1, 2, 1).reshape([3]);
        let colour = distance.ones_like().expand([3]);
        let lamp = [Light::Point { place: ahead * distance.neg(), colour }];
        let normals = vertex_normals(self.vertices.clone(), &self.faces);
        let of = |normals| lambert(self.vertices.clone(), normals, &lamp).narrow(2, 0, 1);
        (of(normals.clone()) + of(normals.neg())) * (1.0 - AMBIENT) + AMBIENT
    }
}

/// The renderer for vertices at these depths, `[views, vertices]`.
fn renderer(scene: &Scene, colour: &Colour, depths: &[f64]) -> ColourRenderer {
    let corners = || scene.faces.iter().flatten();
    let views = depths.chunks_exact(scene.vertices.len() / 3);
    let [near, far] = views
        .flat_map(|view| corners().map(move |&vertex| view[vertex as usize]))
        .filter(|&depth| depth >= NEAR)
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[near, far], depth| {
            [near.min(depth), far.max(depth)]
        });
    // Nothing is visible if everything is behind the camera.
    let [near, far] = if near <= far { [near, far] } else { [NEAR; 2] };
    let planes = [near - BEYOND * far, far + BEYOND * far];
    let depth = DepthSoftness::Family(Family::Exp);
    let depth_scale = match colour.depth_scale {
        Some(scale) => (scale / (planes[1] - planes[0])).max(LEAST_DEPTH),
        None => ColourRenderer::DEPTH_SCALE,
    };
    let phi = [scene.phi.clone(), depth.default_phi(depth_scale)];
    let weighting = Weighting { edge: scene.softness, depth, planes };
    ColourRenderer::with_weighting(scene.faces.clone(), scene.size * colour.samples, weighting, phi)
        .with_tolerance(scene.tolerance)
}
