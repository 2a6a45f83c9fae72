use std::sync::Arc;

use softrast_inverse::{SoftnessAt, Targets};
use softrast_raster::{
    Attributes, Background, ColourRenderer, ImageSize, Projected, RasterBackend, Weighting,
    nearest_faces,
};
use softrast_softness::{DepthSoftness, Family, Softness};
use softrast_tensor::{Tensor, numbers, tensor};

use crate::colour::{Colours, Start};

/// Depths of nearness 1 and 0.
const PLANES: [f64; 2] = [1.0, 2.0];
const DEPTH: DepthSoftness = DepthSoftness::Family(Family::Exp);
/// A triangle that is nearer by this share of the distance between the planes has e times the
/// weight.
///
/// Wider depths make the soft image mix colours that the hard one does not. With narrower ones the
/// edges of the nearest triangles decide alone, and few pixels see them: on pictures with many
/// edges the hard image lost more than 1 dB with a decay from 0.2 to 0.02 instead of a fixed 0.1.
const DEPTH_SCALE: f64 = 0.1;
/// Entries of θ per triangle: corners, colour, nearness.
const ENTRIES: usize = 10;

/// Loose triangles in colours, and their target picture.
///
/// The optimised θ is flat, `[10 triangles]`: first x and y of every corner in NDC, then red, green and blue of every triangle, then its
/// nearness, which is 1 at the near plane and 0 at the far one. Colours and nearness are clamped to [0, 1].
///
/// The background has the mean colour of the picture.
#[derive(Debug)]
pub struct Scene<B: RasterBackend> {
    start: Tensor<B, 1>,
    targets: Targets<B>,
    background: [f64; 3],
    faces: Arc<[[u32; 3]]>,
    size: ImageSize,
}

impl<B: RasterBackend> Scene<B> {
    /// The triangles of `start` and the picture.
    ///
    /// # Panics
    ///
    /// If there is no triangle, or one lacks a colour or a nearness.
    pub fn new(picture: &Colours, start: &Start) -> Self {
        let Start { corners, colours, nearness } = start;
        let count = nearness.len();
        assert!(count > 0, "a scene needs a triangle");
        assert_eq!([corners.len(), colours.len()], [3 * count, count], "corners and colours");
        let mut theta = corners.concat();
        theta.extend(colours.iter().flatten());
        theta.extend(nearness);
        let size = picture.size();
        Self {
            start: tensor(theta, [ENTRIES * count]),
            targets: Targets::new(tensor(picture.planes(), [3, size.height, size.width])),
            background: picture.mean(),
            faces: (0..count as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
            size,
        }
    }

    /// θ before the first step.
    pub fn start(&self) -> Tensor<B, 1> {
        self.start.clone()
    }

    /// The picture, `[3, height, width]`.
    pub fn target(&self) -> Tensor<B, 3> {
        self.targets.full()
    }

    /// θ with colours and nearness clamped to [0, 1]: colours outside cannot be displayed, and depths beyond the planes would drift apart.
    pub fn allowed(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        let [corners, colours, nearness] = self.parts(theta);
        Tensor::cat(vec![corners, colours.clamp(0.0, 1.0), nearness.clamp(0.0, 1.0)], 0)
    }

    /// The soft image at θ under the softness of a step, `[1, 3, height, width]`.
    ///
    /// The weight of a triangle among overlapping ones is its edge softness times its depth
    /// softness: its depth also acts as its opacity, and there is no separate one.
    pub fn image(
        &self,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        let renderer = softness.colour_renderer(&self.faces, PLANES, DEPTH, DEPTH_SCALE);
        let tracked = softness.fixed_place().is_none().then(|| softness.edge().1);
        self.drawn(theta, &renderer, tracked)
    }

    /// [`image`](Self::image) at full size under the parameters `phi` of an edge softness, which receive a gradient.
    pub fn image_with(
        &self,
        theta: Tensor<B, 1>,
        edge: impl Softness,
        phi: Tensor<B, 1>,
        tolerance: f64,
    ) -> Tensor<B, 4> {
        let (faces, weighting) =
            (self.faces.clone(), Weighting { edge, depth: DEPTH, planes: PLANES });
        let values = [numbers(phi.clone()), DEPTH.default_phi(DEPTH_SCALE)];
        let renderer = ColourRenderer::with_weighting(faces, self.size, weighting, values);
        self.drawn(theta, &renderer.with_tolerance(tolerance), Some(phi))
    }

    fn drawn(
        &self,
        theta: Tensor<B, 1>,
        renderer: &ColourRenderer<impl Softness>,
        tracked: Option<Tensor<B, 1>>,
    ) -> Tensor<B, 4> {
        let (vertices, colours, background) = self.inputs(theta, renderer);
        let image = match tracked {
            None => renderer.image(vertices, &colours, &background),
            Some(phi) => {
                let depth = renderer.phi()[1].clone();
                let depth = tensor::<B, 1>(depth.clone(), [depth.len()]);
                renderer.image_with(vertices, &colours, [&phi, &depth], &background)
            }
        };
        image.narrow(1, 0, 3)
    }

    /// The inputs of a renderer at θ.
    fn inputs(
        &self,
        theta: Tensor<B, 1>,
        renderer: &ColourRenderer<impl Softness>,
    ) -> (Projected<B>, Attributes<B>, Background<B>) {
        let [corners, colours, nearness] = self.parts(theta);
        let background = renderer.background(&self.background, &corners.device());
        let colours = Attributes::of_faces(colours.reshape([1, self.faces.len(), 3]));
        (self.vertices(corners, nearness), colours, background)
    }

    /// The hard image at θ, `[1, 3, height, width]`: at each pixel the colour of the nearest triangle. It has no gradient.
    pub fn hard(&self, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        let [corners, colours, nearness] = self.parts(theta);
        let vertices = self.vertices(corners, nearness);
        let (colours, size) = (numbers(colours), self.size);
        let nearest = nearest_faces(vertices, &self.faces, size);
        let level = |k: usize, face: Option<u32>| {
            face.map_or(self.background[k], |face| colours[3 * face as usize + k])
        };
        let planes = (0..3).flat_map(|k| nearest.iter().map(move |&face| level(k, face)));
        tensor(planes.collect(), [1, 3, size.height, size.width])
    }

    /// Mean squared difference of `image` `[1, 3, height, width]` and the picture, `[1]`; the size is
    /// that of the scene, possibly halved some times.
    pub fn image_loss(&self, image: Tensor<B, 4>) -> Tensor<B, 1> {
        self.targets.mse_loss(image.squeeze_dim(0)).mean()
    }

    /// [`image_loss`](Self::image_loss) of the [`image`](Self::image), as one op if nothing is differentiated with respect to φ.
    pub fn loss(
        &self,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        if softness.fixed_place().is_none() {
            return self.image_loss(self.image(theta, softness));
        }
        let renderer = softness.colour_renderer(&self.faces, PLANES, DEPTH, DEPTH_SCALE);
        let (vertices, colours, background) = self.inputs(theta, &renderer);
        let (target, _) = self.targets.at(softness.size());
        renderer.mse_loss(vertices, &colours, &background, target.unsqueeze())
    }

    /// The hard image at θ as SVG: the background, and one polygon per triangle, the farthest first.
    pub fn svg(&self, theta: &[f64]) -> String {
        let (count, size) = (self.faces.len(), self.size);
        let (corners, rest) = theta.split_at(6 * count);
        let (colours, nearness) = rest.split_at(3 * count);
        let hex = |colour: &[f64]| {
            let byte = |level: &f64| (level.clamp(0.0, 1.0) * 255.0).round() as u8;
            colour.iter().map(|level| format!("{:02x}", byte(level))).collect::<String>()
        };
        let ImageSize { height, width } = size;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" shape-rendering=\"crispEdges\">\n<rect width=\"{width}\" \
             height=\"{height}\" fill=\"#{}\"/>\n",
            hex(&self.background)
        );
        let mut order: Vec<usize> = (0..count).rev().collect();
        order.sort_by(|&a, &b| nearness[a].total_cmp(&nearness[b]));
        let [right, down, unit] = [width, height, size.shorter()].map(|side| 0.5 * side as f64);
        for k in order {
            let points = corners[6 * k..6 * k + 6].chunks(2);
            let points =
                points.map(|p| format!("{:.2},{:.2}", right + unit * p[0], down - unit * p[1]));
            let points = points.collect::<Vec<_>>().join(" ");
            let fill = hex(&colours[3 * k..3 * k + 3]);
            svg += &format!("<polygon points=\"{points}\" fill=\"#{fill}\"/>\n");
        }
        svg + "</svg>\n"
    }

    /// Corners, colours and nearness at θ.
    fn parts(&self, theta: Tensor<B, 1>) -> [Tensor<B, 1>; 3] {
        let count = self.faces.len();
        let part = |from: usize, each: usize| theta.clone().narrow(0, from * count, each * count);
        [part(0, 6), part(6, 3), part(9, 1)]
    }

    /// The vertices for the rasterizer, `[1, corners, 3]`.
    fn vertices(&self, corners: Tensor<B, 1>, nearness: Tensor<B, 1>) -> Projected<B> {
        let count = self.faces.len();
        let depth = (nearness.neg() + PLANES[1]).reshape([count, 1, 1]).expand([count, 3, 1]);
        let vertices = Tensor::cat(vec![corners.reshape([count, 3, 2]), depth], 2);
        Projected::new(vertices.reshape([1, 3 * count, 3]))
    }
}

#[cfg(test)]
mod tests {
    use softrast_inverse::{PhiLayout, Resolution, ScheduledRenderer, ScheduledSoftness};
    use softrast_raster::{HostBackend, low_level::Rasterizer};
    use softrast_softness::{EdgeSoftness, Softness};
    use softrast_tensor::{Autodiff, vector};

    use super::*;

    /// A dark triangle over the left half and everything below it, and a nearer bright one at the right, on 4 × 4 pixels.
    fn scene<B: RasterBackend>() -> Scene<B> {
        let picture = Colours::new(vec![[0.2, 0.4, 0.6]; 16], 4);
        let start = Start {
            corners: vec![
                [-3.0, -1.0],
                [1.0, -1.0],
                [-1.0, 3.0],
                [0.0, -5.0],
                [9.0, 0.0],
                [0.0, 5.0],
            ],
            colours: vec![[0.0, 0.2, 0.4], [1.0, 0.6, 0.8]],
            nearness: vec![0.3, 0.7],
        };
        Scene::new(&picture, &start)
    }

    #[test]
    fn the_nearest_triangle_is_seen_and_the_mean_colour_where_there_is_none() {
        let scene = scene::<HostBackend>();
        let red: Vec<f64> = numbers(scene.hard(scene.start()))[..16].to_vec();
        assert_eq!(red, [0.0, 0.0, 1.0, 1.0].repeat(4));
        let away = Tensor::cat(
            vec![scene.start().narrow(0, 0, 12) + 20.0, scene.start().narrow(0, 12, 8)],
            0,
        );
        let empty = numbers(scene.hard(away));
        for (k, level) in [0.2, 0.4, 0.6].into_iter().enumerate() {
            assert!(empty[16 * k..16 * k + 16].iter().all(|x| (x - level).abs() < 1e-6));
        }
    }

    #[test]
    fn a_narrow_softness_shows_nearly_the_hard_image() {
        let scene = scene::<HostBackend>();
        let edge = Family::Gauss;
        let phi = vector(&edge.default_phi(1e-3));
        let soft = numbers(scene.image_with(scene.start(), edge, phi, 1e-4));
        let hard = numbers(scene.hard(scene.start()));
        // Where both overlap, the farther one has a weight of exp(-4).
        assert!(soft.iter().zip(&hard).all(|(a, b)| (a - b).abs() < 0.02), "{soft:?}");
    }

    #[test]
    fn the_loss_as_one_op_is_that_of_the_image() {
        type B = Autodiff<HostBackend>;
        let scene = scene::<B>();
        let edges = ScheduledSoftness::constant(EdgeSoftness::new(Family::Logistic), 0.1);
        let layout = PhiLayout::new(edges, Vec::new(), 1, 4);
        let phi = layout.start();
        let renderer =
            ScheduledRenderer::new(layout, &phi, Rasterizer::new(4), Resolution::Full, None);
        let [one, two] = [true, false].map(|is_one| {
            let (softness, theta) = (renderer.at::<B>(0), scene.start().require_grad());
            let loss = match is_one {
                true => scene.loss(theta.clone(), &softness),
                false => scene.image_loss(scene.image(theta.clone(), &softness)),
            };
            let gradient = theta.grad(&loss.backward()).unwrap();
            [numbers(loss.inner()), numbers(gradient)].concat()
        });
        assert!(one.iter().filter(|x| x.abs() > 1e-3).count() > 5, "{one:?}");
        assert!(one.iter().zip(&two).all(|(a, b)| (a - b).abs() < 1e-6), "{one:?} {two:?}");
    }

    #[test]
    fn what_is_allowed_has_colours_that_can_be_shown_and_moves_no_corner() {
        let scene = scene::<HostBackend>();
        let theta = numbers(scene.allowed(scene.start() * 3.0));
        let start = numbers(scene.start());
        assert!(
            theta[..12].iter().zip(&start).all(|(found, start)| (found - 3.0 * start).abs() < 1e-6)
        );
        assert!(theta[12..].iter().all(|x| (0.0..=1.0).contains(x)));
        assert!(theta[15] == 1.0 && (theta[13] - 0.6).abs() < 1e-6, "{theta:?}");
    }

    #[test]
    fn the_drawing_has_the_farthest_triangle_first() {
        let scene = scene::<HostBackend>();
        let svg = scene.svg(&numbers(scene.start()));
        let places = ["#336699", "#003366", "#ff99cc"].map(|colour| svg.find(colour).unwrap());
        assert!(places.is_sorted(), "{svg}");
        assert!(svg.contains("points=\"2.00,12.00 20.00,2.00 2.00,-8.00\""), "{svg}");
    }
}
