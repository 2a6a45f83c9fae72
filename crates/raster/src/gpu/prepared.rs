use std::{
    fmt,
    sync::{Arc, OnceLock},
};

use softrast_tensor::wgpu::{CubeTensor, WgpuRuntime};

pub(super) type Buffer = CubeTensor<WgpuRuntime>;

/// What a pass forward leaves to the passes back: the faces of all views, if their buffers fit. 44 bytes for each.
#[derive(Clone, Default)]
pub(crate) struct Kept(Arc<OnceLock<Prepared>>);

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
    /// How faces are cut, and how many are drawn; see [`parts`].
    pub(super) slots: Buffer,
}
