//! Colours of whole meshes, in tensor ops.

use softrast_kernel::{
    FAR_AWAY,
    blend::{AREA, counts_from},
};
use softrast_softness::Softness;
use softrast_tensor::{Backend, Bool, Int, Tensor, TensorData};

use super::{
    Scene, chunks,
    distance::{Boundary, corners, signed},
    places,
};

use crate::{
    Attributes, Background, NEAR, Weighting,
    weighting::{FARTHEST_SEEN, floor},
};

/// The logarithm used for a weight of 0.
const HIDDEN: f64 = -1e30;

/// Soft colours of whole meshes: `[views, channels + 1, height, width]`, top row first; the last channel is the faces' share.
///
/// `C = (Σⱼ wⱼ cⱼ + w c) / (Σⱼ wⱼ + w)` over the background and all faces j none of whose corners is nearer than [`NEAR`], farther than
/// 1e15 world units, or projected beyond 1e6 NDC. The weight of a face, `ln wⱼ = ln s(dⱼ) + ln b(zⱼ)`, is that of a [`Weighting`] with the
/// parameters `phi` of its two softnesses. The depth zⱼ and the attributes cⱼ are those at the point of the face nearest to the pixel: the
/// pixel itself if it lies in the face, else the closest point of the boundary. They are interpolated in perspective: 1/z is linear on the
/// screen, and so is c/z. A face without area has no interior. The share is `Σⱼ wⱼ / (Σⱼ wⱼ + w)`.
///
/// For a softness that is 0 beyond some distance, `s` is the exponential of its logarithm minus the floor that keeps the logarithm finite,
/// and 0 below 1e-11. Pixels are computed in chunks of one view; weights are relative to the largest of a pixel.
///
/// Source: Wu et al. 2024, Eq. 3 and 4; docs/notes.md, Colour.
///
/// # Panics
///
/// If shapes do not fit, or a vertex number of a face is out of range.
pub fn blended<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    attributes: &Attributes<B>,
    weighting: &Weighting<impl Softness>,
    phi: [Tensor<B, 1>; 2],
    background: &Background<B>,
) -> Tensor<B, 4> {
    let [views, ..] = vertices.dims();
    let channels = attributes.channels();
    let floor = floor(&weighting.edge);
    let own = attributes.values.dims()[0] > 1;
    let mut parts: Vec<Vec<Tensor<B, 3>>> = vec![Vec::new(); views];
    for (view, pixels) in chunks(scene, views) {
        let vertices = vertices.clone().narrow(0, view, 1);
        let places = places(&vertices, scene, &pixels);
        let points = Points::new(vertices, scene.faces, places);
        let values = attributes.values.clone().narrow(0, if own { view } else { 0 }, 1);
        let log_edge = weighting.edge.log_value(phi[0].clone(), points.distance.clone());
        let log_depth = weighting.log_weight_of_depth(phi[1].clone(), points.depth.clone());
        // Weights that do not count are excluded from the maximum, so that they make no others vanish.
        let nothing = log_edge.clone().lower_equal_elem(counts_from(floor));
        let nothing = nothing.bool_or(points.hidden.clone().expand(log_edge.dims()));
        let log_depth = log_depth.mask_fill(nothing, HIDDEN);
        let log_weight = log_edge + log_depth.clone();
        let behind = background.log_weight.clone().reshape([1, 1, 1]);
        let largest = log_weight.clone().detach().max_dim(2);
        let largest = largest.clone().max_pair(behind.clone().detach().expand(largest.dims()));
        let weight = (log_weight - largest.clone()).exp();
        let rest = (log_depth - largest.clone()).exp() * floor;
        let weight = (weight - rest) * (1.0 - floor).recip();
        let behind = (behind - largest).exp();
        let per_total = (weight.clone().sum_dim(2) + behind.clone()).recip();
        let share = weight * per_total.clone();
        let colour = background.colour.clone().reshape([1, 1, channels]);
        let behind = (behind * per_total) * colour;
        let corners = corner_values(&values, &attributes.entries);
        let seen = match &attributes.texture {
            None => {
                let parts = points.weights.into_iter().zip(corners);
                parts
                    .map(|(weights, values)| (share.clone() * weights).matmul(values))
                    .reduce(Tensor::add)
            }
            Some(texture) => {
                let [u, v] = [0, 1].map(|number| {
                    let of_faces =
                        |values: Tensor<B, 3>| values.narrow(2, number, 1).swap_dims(1, 2);
                    let parts = points.weights.iter().zip(corners.clone());
                    let parts = parts.map(|(weights, values)| weights.clone() * of_faces(values));
                    parts.reduce(Tensor::add).expect("three corners")
                });
                let sampled = sampled(texture.clone(), [u, v]).into_iter();
                let channels =
                    sampled.map(|channel| (share.clone() * channel).sum_dim(2)).collect();
                Some(Tensor::cat(channels, 2))
            }
        };
        let seen = behind + seen.expect("three corners");
        parts[view].push(Tensor::cat(vec![seen, share.sum_dim(2)], 2).swap_dims(1, 2));
    }
    let of_view = |parts: Vec<Tensor<B, 3>>| Tensor::cat(parts, 2);
    Tensor::cat(parts.into_iter().map(of_view).collect(), 0).reshape([
        views,
        channels + 1,
        scene.size.height,
        scene.size.width,
    ])
}

/// Values `[1, entries, numbers]` at the corners of the faces: `[1, faces, numbers]` each.
fn corner_values<B: Backend>(values: &Tensor<B, 3>, entries: &[[u32; 3]]) -> [Tensor<B, 3>; 3] {
    [0, 1, 2].map(|k| {
        let index = entries.iter().map(|face| i64::from(face[k])).collect::<Vec<_>>();
        let data = TensorData::new(index, [entries.len()]);
        values.clone().select(1, Tensor::<B, 1, Int>::from_data(data, &values.device()))
    })
}

/// The channels of a texture `[height, width, channels]` at positions u, v of any one shape; see [`Attributes::with_texture`].
fn sampled<B: Backend>(texture: Tensor<B, 3>, [u, v]: [Tensor<B, 3>; 2]) -> Vec<Tensor<B, 3>> {
    let [height, width, channels] = texture.dims();
    let shape = u.dims();
    let texels = texture.reshape([height * width, channels]);
    let x = u * width as f64 - 0.5;
    let y = (v.neg() + 1.0) * height as f64 - 0.5;
    let [left, above] = [&x, &y].map(|x| x.clone().detach().floor());
    let (right, down) = (x - left.clone(), y - above.clone());
    let within = |at: Tensor<B, 3>, count: usize| {
        let turns = at.clone().div_scalar(count as f64).floor();
        at - turns * count as f64
    };
    let at = |row: f64, column: f64| {
        let row = within(above.clone() + row, height);
        let texel = row * width as f64 + within(left.clone() + column, width);
        texels.clone().select(0, texel.flatten::<1>(0, 2).int())
    };
    let shares = [
        (right.clone().neg() + 1.0) * (down.clone().neg() + 1.0),
        right.clone() * (down.clone().neg() + 1.0),
        (right.clone().neg() + 1.0) * down.clone(),
        right * down,
    ];
    let corners = [at(0.0, 0.0), at(0.0, 1.0), at(1.0, 0.0), at(1.0, 1.0)];
    let channel = |channel: usize| {
        let parts = shares.iter().zip(&corners).map(|(share, texels)| {
            share.clone() * texels.clone().narrow(1, channel, 1).reshape(shape)
        });
        parts.reduce(Tensor::add).expect("four texels")
    };
    (0..channels).map(channel).collect()
}

/// Points of faces nearest to pixels, each `[views, pixels, faces]`.
struct Points<B: Backend> {
    /// Signed distance, positive inside.
    distance: Tensor<B, 3>,
    /// Depth of the point.
    depth: Tensor<B, 3>,
    /// Barycentric weights of the point on the face itself.
    weights: [Tensor<B, 3>; 3],
    /// Faces that are not drawn, `[views, 1, faces]`.
    hidden: Tensor<B, 3, Bool>,
}

impl<B: Backend> Points<B> {
    fn new(vertices: Tensor<B, 3>, faces: &[[u32; 3]], pixels: Tensor<B, 2>) -> Self {
        let corners = corners(vertices, faces);
        let seen = |[x, y, z]: &[Tensor<B, 3>; 3]| {
            let far = [(x, FAR_AWAY), (y, FAR_AWAY), (z, FARTHEST_SEEN)];
            let within = far.map(|(x, most)| x.clone().abs().lower_equal_elem(most));
            within.into_iter().fold(z.clone().greater_equal_elem(NEAR), Tensor::bool_and)
        };
        let drawn = corners.iter().map(seen).reduce(Tensor::bool_and).expect("three corners");
        let hidden = drawn.bool_not();
        // Faces that are not drawn become a point at depth 1, which avoids invalid roots and divisions.
        let corners = corners.map(|[x, y, z]| {
            let [x, y] = [x, y].map(|x| x.mask_fill(hidden.clone(), 0.0));
            [x, y, z.mask_fill(hidden.clone(), 1.0)]
        });
        let boundary = Boundary::new(&corners, pixels);
        let on_boundary = boundary.weights();
        let Boundary { distance2, inside, sides, .. } = boundary;
        let [side_a, side_b, side_c] = sides;
        let area = side_a.clone() + side_b.clone() + side_c.clone();
        let own = inside.clone().bool_and(area.clone().greater_elem(AREA));
        let per_area = area.mask_fill(own.clone().bool_not(), 1.0).recip();
        // Corner k is opposite edge k + 1.
        let mut across = [side_b, side_c, side_a].into_iter();
        let parts = on_boundary.map(|weight| {
            let side = across.next().expect("three sides");
            weight.mask_where(own.clone(), side * per_area.clone())
        });
        let mut depths = corners.iter().map(|[_, _, z]| z.clone().recip());
        let parts = parts.map(|part| part * depths.next().expect("three corners"));
        let [p0, p1, p2] = parts.clone();
        let depth = (p0 + p1 + p2).recip();
        let distance = signed(distance2, inside);
        Self { distance, weights: parts.map(|part| part * depth.clone()), depth, hidden }
    }
}
