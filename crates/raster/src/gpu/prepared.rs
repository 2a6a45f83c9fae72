use std::{
    fmt,
    sync::{Arc, OnceLock},
};

use softrast_tensor::wgpu::{CubeTensor, WgpuRuntime};

use super::topology::Topology;

pub(super) type Buffer = CubeTensor<WgpuRuntime>;

/// GPU state of an op of sums, in addition to its inputs.
#[derive(Clone, Debug)]
pub(crate) struct SumOnGpu {
    pub(super) topology: Topology,
    /// Cached faces, for a recorded op.
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

/// Cache between the forward pass and the backward passes: the faces of all views, if their buffers fit. 44 bytes per face.
#[derive(Clone, Default)]
pub(super) struct Kept(Arc<OnceLock<Prepared>>);

impl fmt::Debug for Kept {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_tuple("Kept").field(&self.0.get().is_some()).finish()
    }
}

impl Kept {
    pub(super) fn get(&self) -> Option<&Prepared> {
        self.0.get()
    }

    pub(super) fn set(&self, faces: Prepared) {
        // Another call may have set it first, with the same faces.
        let _ = self.0.set(faces);
    }
}

/// The faces of some of the views.
#[derive(Clone)]
pub(super) struct Prepared {
    pub(super) first_view: usize,
    pub(super) views: usize,
    pub(super) corners: Buffer,
    pub(super) reaches: Buffer,
    /// The split of faces, and the number drawn; see [`parts`](super::parts).
    pub(super) slots: Buffer,
}
