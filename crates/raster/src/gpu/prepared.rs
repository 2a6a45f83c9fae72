use std::{
    fmt,
    sync::{Arc, OnceLock},
};

use softrast_tensor::wgpu::{CubeTensor, WgpuRuntime};

use super::topology::Topology;

pub(super) type Buffer = CubeTensor<WgpuRuntime>;

/// An op of sums on a GPU, beside its inputs.
#[derive(Clone, Debug)]
pub(crate) struct SumOnGpu {
    pub(super) topology: Topology,
    /// Prepared faces, for an op that is recorded.
    pub(super) kept: Option<Kept>,
    /// Whether terms are like optical depths: none that counts is lost beside the largest in a sum of whole numbers.
    pub(super) like_depths: bool,
}

impl SumOnGpu {
    pub(crate) fn new(like_depths: bool) -> Self {
        Self { topology: Topology::default(), kept: None, like_depths }
    }

    /// One for a call whose passes share what they find out.
    pub(crate) fn keeping(&self) -> Self {
        Self { kept: Some(self.kept.clone().unwrap_or_default()), ..self.clone() }
    }
}

/// Left by a pass forward to the passes back: the faces of all views, if their buffers fit. 44 bytes for each.
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
        // Another call may have been as quick; its faces are the same.
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
    /// How faces are cut, and how many are drawn; see [`parts`](super::parts).
    pub(super) slots: Buffer,
}
