//! Support of each face: it increases with the face's depth weight.

use rayon::prelude::*;

use super::{
    depth::{DepthGrid, LEAST},
    scene::{Inputs, NOTHING},
};
use crate::{
    bands::{Bands, View, bands_of_view},
    float::{Float, Vectors},
    reach::{Reach, in_pixels, is_seen_clockwise},
    table::Grid,
};

/// Radius of a face that counts everywhere, in NDC.
const EVERYWHERE: f64 = 4e6;

/// Vertices or faces per rayon task.
const AT_ONCE: usize = 4096;

/// A table with its knots, as scalars.
struct Curve<'a, F> {
    grid: Grid,
    knots: Vec<f64>,
    rows: &'a [[F; 4]],
}

impl<F: Float> Curve<'_, F> {
    /// The value of a row at a position in it.
    fn value(&self, row: usize, t: f64) -> f64 {
        let [a, b, c, d] = self.rows[row].map(Float::to_f64);
        a + t * (b + t * (c + t * d))
    }

    /// The value at a signed distance: on the outer side if it is below 0, else on the inner side.
    fn at(&self, x: f64) -> f64 {
        let side = usize::from(x >= 0.0);
        let first = side * (self.grid.cells() + 1);
        let y = self.grid.position(side, x.abs()).max(0.0);
        let above = self.knots.partition_point(|&knot| knot <= y);
        if above >= self.knots.len() {
            return self.value(first + self.grid.cells(), 0.0);
        }
        let [low, high] = [self.knots[above - 1], self.knots[above]];
        self.value(first + above - 1, (y - low) / (high - low))
    }
}

/// Distance outside a face up to which an edge softness is above a threshold.
struct EdgeReach<'a, F> {
    curve: Curve<'a, F>,
    /// For each knot, the largest logarithm from there on.
    most: Vec<f64>,
}

impl<'a, F: Float> EdgeReach<'a, F> {
    fn new(grid: Grid, rows: &'a [[F; 4]], floor: f64) -> Self {
        let curve = Curve { grid, knots: grid.knots(), rows };
        let cells = grid.cells();
        let log = |negative: f64| {
            let rest = (-negative).exp() - floor;
            match floor > 0.0 {
                true if rest <= NOTHING * floor => f64::NEG_INFINITY,
                true => (rest / (1.0 - floor)).ln(),
                false => -negative,
            }
        };
        let mut so_far = log(curve.value(2 * cells + 1, 0.0));
        let mut most = vec![so_far; cells + 1];
        for cell in (0..cells).rev() {
            let values = [0.0, 0.5, 1.0].map(|t| log(curve.value(cells + 1 + cell, t)));
            so_far = values.into_iter().fold(so_far, f64::max);
            most[cell] = so_far;
        }
        Self { curve, most }
    }

    /// The distance in NDC beyond which no logarithm is above `least`; `None` if none is above it anywhere.
    fn of(&self, least: f64) -> Option<f64> {
        if least >= 0.0 {
            return None;
        }
        let first = self.most.partition_point(|&most| most > least);
        let radius = |&y: &f64| self.curve.grid.distance(1, y);
        Some(self.curve.knots.get(first).map_or(EVERYWHERE, radius).min(EVERYWHERE))
    }
}

/// Faces by band, and their depth weights.
pub(super) struct Reached {
    pub(super) bands: Bands,
    /// Logarithm of the largest depth weight of each face of each view.
    pub(super) logs: Vec<Vec<f32>>,
    /// Logarithm of the relative weight below which a face is culled at a pixel.
    pub(super) least: f64,
}

/// The faces of each band of each view.
///
/// A face is culled at a pixel where its weight is at most `tolerance / faces` times the background's, so that all culled weights together
/// are at most `tolerance` times the background's weight, which is below the sum W of all weights. Culling a weight w of a colour c changes
/// `C = Σ w c / W` by `w |c - C| / W`.
pub(super) fn bands<F: Vectors>(inputs: &Inputs<F>) -> Reached {
    let (edge_rows, depth_rows) = inputs.split_tables(inputs.tables);
    let edge = EdgeReach::new(inputs.edge, edge_rows, inputs.floor);
    let depth = match inputs.depth {
        DepthGrid::Table(grid) => Some(Curve { grid, knots: grid.knots(), rows: depth_rows }),
        DepthGrid::Exponential | DepthGrid::Line { .. } => None,
    };
    let [near_plane, far_plane] = inputs.planes;
    let per_range = (far_plane - near_plane).recip();
    let log_weight = |z: f64| match (&depth, inputs.depth) {
        (Some(curve), _) => -curve.at((z - near_plane) * per_range),
        (None, DepthGrid::Exponential) => {
            let [a, c, ..] = depth_rows[0].map(Float::to_f64);
            (a * (near_plane - z) * per_range + c).clamp(LEAST, 0.0)
        }
        (None, DepthGrid::Line { floor }) => {
            let [a, c, ..] = depth_rows[0].map(Float::to_f64);
            let nearness = (far_plane - z) * per_range;
            (if nearness > 0.0 { a * nearness } else { -c * nearness }).max(floor).ln()
        }
        (None, DepthGrid::Table(_)) => unreachable!("a table has a curve"),
    };
    let background = inputs.background[inputs.channels()].to_f64();
    let part = (inputs.tolerance / inputs.faces.len() as f64).ln();
    let least = part + background;
    let count = bands_of_view(inputs.views, inputs.size);
    let (near, far) = (F::from_f64(inputs.near), F::from_f64(inputs.far));
    let nowhere = [F::from_f64(f64::INFINITY); 2];
    let vertices = inputs.vertices.len() / 3 / inputs.views.max(1);
    let view = |numbers: &[F]| {
        let (x, rest) = numbers.split_at(vertices);
        let (y, z) = rest.split_at(vertices);
        // Position of a vertex, and the support of a face at its depth. The nearest corner of a face, or the farthest for a line, has the
        // largest weight of all its points.
        let place = |k: usize| {
            let drawn = z[k] >= near && z[k] <= far;
            let log = if drawn { log_weight(z[k].to_f64()) } else { f64::NEG_INFINITY };
            let place = in_pixels([x[k], y[k], z[k]], near, inputs.size);
            (if drawn { place } else { nowhere }, edge.of(least - log), log)
        };
        let places: Vec<_> =
            (0..vertices).into_par_iter().with_min_len(AT_ONCE).map(place).collect();
        let half = 0.5 * inputs.size.shorter() as f64;
        let reach = |face: &[u32; 3]| {
            let corners = face.map(|v| places[v as usize].0);
            if inputs.culls && is_seen_clockwise(face.map(|v| [x[v as usize], y[v as usize]])) {
                return (Reach::NOTHING, (0.0, f32::NEG_INFINITY));
            }
            let radius = face.iter().filter_map(|&v| places[v as usize].1).reduce(f64::max);
            let reach = radius
                .and_then(|radius| Reach::around(corners, F::from_f64(radius * half), inputs.size));
            let log =
                face.map(|v| places[v as usize].2).into_iter().fold(f64::NEG_INFINITY, f64::max);
            (reach.unwrap_or(Reach::NOTHING), (radius.unwrap_or(0.0) as f32, log as f32))
        };
        let faces = inputs.faces.par_iter().with_min_len(AT_ONCE);
        let (reaches, (radii, logs)): (Vec<Reach>, (_, Vec<f32>)) = faces.map(reach).unzip();
        let drawn = reaches.iter().filter(|&&reach| reach != Reach::NOTHING).count();
        (View::new(reaches, radii, drawn, count, inputs.size), logs)
    };
    let views = inputs.vertices.par_chunks(3 * vertices.max(1)).map(view);
    let (views, logs) = views.unzip();
    Reached { bands: Bands { views, count }, logs, least: part }
}
