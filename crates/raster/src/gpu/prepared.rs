use softrast_tensor::gpu::{CubeRuntime, CubeTensor};

use super::{kept::Kept, topology::Topology};

pub(super) type Buffer<R> = CubeTensor<R>;

/// GPU state of an op of sums, in addition to its inputs.
#[derive(Clone, Debug)]
pub(crate) struct SumOnGpu {
    pub(super) topology: Topology,
    /// Cache between the forward pass and the backward passes of a recorded op: the faces of all views, [`Prepared`], if their buffers fit.
    /// 44 bytes per face.
    pub(super) kept: Option<Kept>,
    /// Whether terms are like optical depths: no significant term is lost next to the largest in a sum of integers.
    pub(super) like_depths: bool,
}

impl SumOnGpu {
    pub(crate) fn new(like_depths: bool) -> Self {
        Self { topology: Topology::default(), kept: None, like_depths }
    }

    /// The state for a call whose passes share prepared faces.
    pub(crate) fn keeping(&self) -> Self {
        Self { kept: Some(self.kept.clone().unwrap_or_default()), ..self.clone() }
    }
}

/// The faces of some of the views.
#[derive(Clone)]
pub(super) struct Prepared<R: CubeRuntime> {
    pub(super) first_view: usize,
    pub(super) views: usize,
    pub(super) corners: Buffer<R>,
    pub(super) reaches: Buffer<R>,
    /// The split of faces, and the number drawn; see [`parts`](super::parts).
    pub(super) slots: Buffer<R>,
}
