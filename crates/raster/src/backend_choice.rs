//! The backend of a program, chosen at run time; library code is generic.

use std::fmt;

use crate::NoAdapter;

/// Backend for small computations, whatever backend draws: parameters, supports, metrics. On the CPU, in f32; with `ndarray`, `wgpu` or `cuda`
/// it also supports f64.
#[cfg(any(feature = "ndarray", feature = "gpu"))]
pub type HostBackend = softrast_tensor::NdArray<f32>;
/// Backend for small computations, whatever backend draws: parameters, supports, metrics. On the CPU, in f32.
#[cfg(not(any(feature = "ndarray", feature = "gpu")))]
pub type HostBackend = softrast_tensor::Flex;

/// A backend that programs compute on, in f32.
///
/// [`compiled_backends!`](crate::compiled_backends) lists those of a program, and
/// [`on_backend!`](crate::on_backend) goes from the choice to a type.
///
/// ```
/// use softrast_raster::{BackendChoice, NoAdapter, NoBackend};
///
/// let compiled = &[BackendChoice::NdArray];
/// let choice = BackendChoice::select(compiled, None)?;
/// assert_eq!((choice.name(), choice.title()), ("ndarray", "ndarray f32"));
/// let missing = BackendChoice::select(compiled, Some("flex"));
/// assert!(matches!(missing, Err(NoBackend::Missing { asked: BackendChoice::Flex, .. })));
/// // Fails where wgpu finds no adapter.
/// let up: Result<(), NoAdapter> = choice.set_up();
/// assert_eq!(up, Ok(()));
/// # Ok::<(), NoBackend>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendChoice {
    /// `burn-ndarray`, on the CPU.
    NdArray,
    /// `burn-flex`, on the CPU.
    Flex,
    /// wgpu: Vulkan, Metal or `WebGPU`, whichever the system has.
    Wgpu,
    /// CUDA, on NVIDIA cards.
    Cuda,
}

impl BackendChoice {
    /// All backends.
    pub const ALL: [Self; 4] = [Self::NdArray, Self::Flex, Self::Wgpu, Self::Cuda];

    /// Name on the command line, and of the feature that compiles it in.
    pub fn name(self) -> &'static str {
        match self {
            Self::NdArray => "ndarray",
            Self::Flex => "flex",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
        }
    }

    /// Name and float type, for result tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::NdArray => "ndarray f32",
            Self::Flex => "flex f32",
            Self::Wgpu => "wgpu f32",
            Self::Cuda => "cuda f32",
        }
    }

    /// The requested backend, or the first of those compiled in.
    ///
    /// # Errors
    ///
    /// If it does not exist or was not compiled in.
    ///
    /// # Panics
    ///
    /// If nothing was compiled in.
    pub fn select(compiled: &'static [Self], asked: Option<&str>) -> Result<Self, NoBackend> {
        let Some(asked) = asked else {
            return Ok(*compiled.first().expect("a program has a backend"));
        };
        let Some(choice) = Self::ALL.into_iter().find(|choice| choice.name() == asked) else {
            return Err(NoBackend::Unknown(asked.to_owned()));
        };
        if !compiled.contains(&choice) {
            return Err(NoBackend::Missing { asked: choice, compiled });
        }
        Ok(choice)
    }

    /// Sets the backend up. Call it before the first tensor is created, which would panic if setup fails. In a browser setup is
    /// asynchronous: the page calls burn's `init_setup_async` instead.
    ///
    /// # Errors
    ///
    /// [`NoAdapter`] if it is wgpu or cuda and the system lacks an adapter, a driver, or what compiles the kernels.
    pub fn set_up(self) -> Result<(), NoAdapter> {
        #[cfg(all(feature = "wgpu", not(target_family = "wasm")))]
        if self == Self::Wgpu {
            crate::adapter_name()?;
        }
        #[cfg(feature = "cuda")]
        if self == Self::Cuda {
            crate::cuda_device_name()?;
        }
        Ok(())
    }
}

impl fmt::Display for BackendChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The requested backend is not available.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoBackend {
    /// No backend has this name.
    #[error("there is no backend {0:?}: expected ndarray, flex, wgpu or cuda")]
    Unknown(String),
    /// Its feature was off when the program was built.
    #[error(
        "this program was built without {asked}, for {}: build it with the feature {asked}",
        names(compiled)
    )]
    Missing {
        /// The requested backend.
        asked: BackendChoice,
        /// The backends compiled in.
        compiled: &'static [BackendChoice],
    },
}

fn names(choices: &[BackendChoice]) -> String {
    choices.iter().map(|choice| choice.name()).collect::<Vec<_>>().join(" and ")
}

/// The backends whose features (`ndarray`, `flex`, `wgpu`, `cuda`) are on in the calling crate, as `&'static [BackendChoice]`.
#[macro_export]
macro_rules! compiled_backends {
    () => {
        &[
            #[cfg(feature = "ndarray")]
            $crate::BackendChoice::NdArray,
            #[cfg(feature = "flex")]
            $crate::BackendChoice::Flex,
            #[cfg(feature = "wgpu")]
            $crate::BackendChoice::Wgpu,
            #[cfg(feature = "cuda")]
            $crate::BackendChoice::Cuda,
        ]
    };
}

/// Evaluates `$work` with `$Backend` as an alias of the chosen backend: `on_backend!(choice, B => draw::<B>())`.
///
/// Compiled once for each of `ndarray`, `flex`, `wgpu` and `cuda` whose feature is on in the calling crate, regardless of features that other
/// crates turn on in this one.
///
/// # Panics
///
/// If the choice is not one of [`compiled_backends!`](crate::compiled_backends) of the calling crate.
#[macro_export]
macro_rules! on_backend {
    ($choice:expr, $Backend:ident => $work:expr) => {
        match $choice {
            #[cfg(feature = "ndarray")]
            $crate::BackendChoice::NdArray => {
                type $Backend = $crate::tensor::NdArray<f32>;
                $work
            }
            #[cfg(feature = "flex")]
            $crate::BackendChoice::Flex => {
                type $Backend = $crate::tensor::Flex;
                $work
            }
            #[cfg(feature = "wgpu")]
            $crate::BackendChoice::Wgpu => {
                type $Backend = $crate::Wgpu;
                $work
            }
            #[cfg(feature = "cuda")]
            $crate::BackendChoice::Cuda => {
                type $Backend = $crate::Cuda;
                $work
            }
            #[allow(unreachable_patterns, reason = "all features may be on")]
            other => unreachable!("{other} was not compiled in"),
        }
    };
}

#[cfg(test)]
mod tests {
    use BackendChoice::{Flex, NdArray, Wgpu};

    use super::*;

    #[test]
    fn the_first_is_chosen_unless_another_is_asked_for() {
        assert_eq!(BackendChoice::select(&[Flex, Wgpu], None), Ok(Flex));
        assert_eq!(BackendChoice::select(&[Flex, Wgpu], Some("wgpu")), Ok(Wgpu));
    }

    #[test]
    fn what_is_not_there_is_refused_in_a_line_that_helps() {
        let missing = BackendChoice::select(&[NdArray, Flex], Some("wgpu")).unwrap_err();
        assert_eq!(
            missing.to_string(),
            "this program was built without wgpu, for ndarray and flex: build it with the feature wgpu"
        );
        let unknown = BackendChoice::select(&[NdArray], Some("opencl")).unwrap_err();
        assert!(unknown.to_string().contains("flex"), "{unknown}");
    }
}
