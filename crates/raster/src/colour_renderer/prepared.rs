use softrast_softness::{DepthSoftness, EdgeSoftness, OPAQUE, Softness};
use softrast_tensor::{Backend, Tensor, vector};

use crate::{
    HostBackend, NEAR, Weighting,
    log_curve::{DepthCurve, LogCurve, Precision},
    soft_renderer::stretch,
    weighting::floor,
};

/// Amount by which the logarithm of the background's weight may fall below the one that tables were chosen for.
const MARGIN: f64 = 3.0;
/// Knots for the parameters `phi`.
#[derive(Clone, Debug)]
pub(super) struct Prepared<S> {
    pub(super) phi: [Vec<f64>; 2],
    /// Logarithm of the background's weight that the tables are valid for.
    pub(super) log_weight: f64,
    /// Number of faces that the knots are valid for.
    pub(super) room: usize,
    pub(super) edge: LogCurve<S>,
    pub(super) depth: DepthCurve,
}

impl<S: Softness> Prepared<S> {
    /// Half of the tolerance goes to culling, the other half to interpolation. Errors of the logarithms of both factors of a weight by a
    /// quarter of it each would suffice if all had one sign; together they move a mean by at most half of their size.
    pub(super) fn new(
        weighting: &Weighting<S>,
        phi: &[Vec<f64>; 2],
        room: usize,
        tolerance: f64,
        log_weight: f64,
    ) -> Self {
        let device = Default::default();
        let log_weight = log_weight - MARGIN;
        let accuracy = tolerance / 2.0;
        let least = (accuracy / room as f64).ln() + log_weight;
        let highest = match weighting.depth {
            DepthSoftness::Family(_) => 0.0,
            DepthSoftness::Mlp => {
                let ends = DepthSoftness::mlp_at_ends(vector::<HostBackend>(&phi[1]));
                let ends: Vec<f64> = ends.into_data().iter().collect();
                let [near, far] = weighting.planes;
                // This only determines the extent of the table.
                let nearest = (far - NEAR) / (far - near);
                (ends[0] * nearest).max(ends[1]).max(OPAQUE).ln()
            }
        };
        let [edge, depth] = phi;
        let by_depth = Precision { accuracy, least, floor: 0.0 };
        let floor = floor(&weighting.edge);
        let by_edge = Precision { least: least - highest, floor, ..by_depth };
        let edge = LogCurve::new::<HostBackend>(weighting.edge.clone(), edge, by_edge, &device);
        let depth = DepthCurve::new::<HostBackend>(weighting.depth, depth, by_depth, &device);
        Self { phi: phi.clone(), log_weight, room, edge, depth }
    }

    /// Knots for parameters `phi`, if their softnesses are the prepared ones, stretched.
    pub(super) fn stretched_to(
        &self,
        weighting: &Weighting<S>,
        phi: &[Vec<f64>; 2],
    ) -> Option<Self> {
        if self.phi == *phi {
            return Some(self.clone());
        }
        let [edge, depth] = &self.phi;
        let edge = self.edge.stretched(stretch(&weighting.edge, edge, &phi[0])?)?;
        let depth = match (self.depth, weighting.depth) {
            (DepthCurve::Family(curve), DepthSoftness::Family(family)) => {
                DepthCurve::Family(curve.stretched(stretch(&family, depth, &phi[1])?)?)
            }
            (DepthCurve::Exponential, _) => DepthCurve::Exponential,
            (curve, _) if *depth == phi[1] => curve,
            _ => return None,
        };
        Some(Self { phi: phi.clone(), edge, depth, ..*self })
    }

    pub(super) fn tables<B: Backend>(&self, [edge, depth]: [Tensor<B, 1>; 2]) -> Tensor<B, 2> {
        tables(self.edge.table(edge), self.depth.table(depth))
    }
}

impl<S: Softness> PartialEq for Prepared<S> {
    fn eq(&self, other: &Self) -> bool {
        let curves = |of: &Self| (of.edge.grid(), of.depth);
        self.phi == other.phi && curves(self) == curves(other)
    }
}

/// Computes the tables of an op that runs on slices.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct WeightTables<S = EdgeSoftness>(pub(super) Prepared<S>);

impl<S: Softness> WeightTables<S> {
    /// Rows of both tables.
    pub fn rows(&self) -> usize {
        self.0.edge.grid().rows() + self.0.depth.grid().rows()
    }

    /// Both tables, `[rows, 4]`, for parameters of the edge and the depth softness.
    pub fn of<B: Backend>(&self, phi: [Tensor<B, 1>; 2]) -> Tensor<B, 2> {
        self.0.tables(phi)
    }
}

/// Both tables as one input of the op, `[rows, 4]`.
fn tables<B: Backend>(edge: Tensor<B, 2>, depth: Tensor<B, 2>) -> Tensor<B, 2> {
    Tensor::cat(vec![edge, depth], 0)
}
