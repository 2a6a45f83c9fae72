//! Tensors, backends and automatic differentiation of softrast: those of burn 0.21.
//!
//! This is the only crate of the workspace that depends on burn directly, so replacing burn, or its release, changes a single file. The
//! types are burn's own: a tensor of burn 0.21 is a tensor here. Networks use burn's modules and optimisers through `burn`, the whole
//! crate, which the Cargo feature `burn` compiles.
//!
//! The Cargo features `ndarray`, `flex`, `wgpu` and `cuda` compile the backends of these names.
//!
//! ```
//! use softrast_tensor::{Autodiff, NdArray, numbers, vector};
//!
//! let x = vector::<Autodiff<NdArray>>(&[1.0, 2.0]).require_grad();
//! let gradients = (x.clone() * x.clone()).sum().backward();
//! assert_eq!(numbers(x.grad(&gradients).unwrap()), [2.0, 4.0]);
//! ```

mod plain;

#[cfg(feature = "burn")]
#[doc(no_inline)]
pub use burn;
#[doc(no_inline)]
pub use burn_autodiff::Autodiff;
#[cfg(feature = "flex")]
#[doc(no_inline)]
pub use burn_flex::Flex;
#[cfg(feature = "ndarray")]
#[doc(no_inline)]
pub use burn_ndarray::{NdArray, NdArrayTensor};
#[doc(no_inline)]
pub use burn_tensor::{
    Bool, DType, Element, ElementConversion, FloatDType, IndexingUpdateOp, Int, Shape, Slice,
    Tensor, TensorData, TensorMetadata, TensorPrimitive, Transaction, activation,
    backend::{AutodiffBackend, Backend},
    ops::{FloatTensor, FloatTensorOps},
    read_sync, try_read_sync,
};
pub use plain::{numbers, tensor, tensor_on, vector};

/// Types to register an op with a custom backward pass.
pub mod autodiff {
    #[doc(no_inline)]
    pub use burn_autodiff::{
        checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
        grads::Gradients,
        ops::{Backward, Ops, OpsKind},
    };
}

/// The backend for GPUs, generic over the runtime, and the types of its kernels.
#[cfg(feature = "gpu")]
pub mod gpu {
    #[doc(no_inline)]
    pub use burn_cubecl::{
        BoolElement, CubeBackend, CubeRuntime, cubecl, kernel::into_contiguous,
        ops::numeric::zeros_client, tensor::CubeTensor,
    };
}

/// The runtime of the backend for GPUs over Vulkan, Metal, DirectX and `WebGPU`.
#[cfg(feature = "wgpu")]
pub mod wgpu {
    #[doc(no_inline)]
    pub use burn::backend::wgpu::{
        WgpuDevice, WgpuRuntime,
        graphics::{AutoGraphicsApi, GraphicsApi},
        init_setup, init_setup_async,
    };
}

/// The runtime of the backend for GPUs over CUDA.
#[cfg(feature = "cuda")]
pub mod cuda {
    #[doc(no_inline)]
    pub use burn_cubecl::cubecl::cuda::{CudaDevice, CudaRuntime, install};
}
