//! Functions of arrays with their derivatives, for frameworks that keep no state between the passes.

use std::{
    collections::HashMap,
    hash::{BuildHasher, RandomState},
    sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, Weak},
};

use pyo3::{prelude::*, types::PyCapsule};
#[cfg(feature = "cuda")]
use softrast_raster::Cuda;
use softrast_raster::low_level::{ElementaryOp, PixelLoss};
use softrast_tensor::NdArray;

use crate::{
    arrays::{Array, Borrowed, Floats},
    device,
    dlpack::{self, Lent},
    guard::{refused, unwound},
    kind::{Call, Kind, Order, misfit},
    losses::Losses,
    op::Op,
    passes::{Blends, Silhouettes},
};

/// A function of arrays with its derivatives. All arrays of a call are C-contiguous and of one float type, float32 or float64, except that φ may
/// have the other one; they are borrowed, not copied. Arrays may have further axes in front, all of them the same.
#[pyclass(frozen, module = "softrast._native")]
pub(crate) struct Function(Arc<Known>);

/// A function, and the number under which compiled code knows it.
pub(crate) struct Known {
    kind: Kind,
    id: i64,
}

/// All functions that exist, by their numbers. The first number is random: code that another process compiled finds no function.
static FUNCTIONS: LazyLock<Mutex<Functions>> = LazyLock::new(|| {
    let first = RandomState::new().hash_one(std::process::id()) >> 2;
    Mutex::new(Functions { next: first as i64, by_id: HashMap::new() })
});

struct Functions {
    next: i64,
    by_id: HashMap<i64, Weak<Known>>,
}

fn functions() -> MutexGuard<'static, Functions> {
    FUNCTIONS.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Known {
    fn drop(&mut self) {
        functions().by_id.remove(&self.id);
    }
}

impl Known {
    /// The function with a number, if it still exists.
    pub(crate) fn find(id: i64) -> Option<Arc<Self>> {
        functions().by_id.get(&id).and_then(Weak::upgrade)
    }
}

impl Function {
    fn new(kind: Kind) -> Self {
        let mut functions = functions();
        let id = functions.next;
        functions.next += 1;
        let known = Arc::new(Known { kind, id });
        functions.by_id.insert(id, Arc::downgrade(&known));
        Self(known)
    }

    /// Silhouettes under the φ of the renderer, or under a φ that is given.
    pub(crate) fn silhouette(of: Arc<Silhouettes>, own: bool) -> Self {
        Self::new(Kind::Silhouette(of, own))
    }

    pub(crate) fn loss(of: Losses) -> Self {
        Self::new(Kind::Loss(of))
    }

    pub(crate) fn blend(of: Blends) -> Self {
        Self::new(Kind::Blend(Box::new(of)))
    }
}

/// Orbits `[views, 4]` to matrices `[views, 3, 4]`.
#[pyfunction]
pub(crate) fn orbit_matrix() -> Function {
    Function::new(Kind::Op(Op::elementary(ElementaryOp::OrbitMatrix), &[2], true))
}

/// Points `[1 or views, V, 3]` and matrices `[views, 3, 4]` to `[views, 3, V]`: x and y in NDC, and depth.
#[pyfunction]
pub(crate) fn perspective() -> Function {
    Function::new(Kind::Op(Op::elementary(ElementaryOp::Perspective), &[3, 3], false))
}

/// Images `[views, height, width]` and targets `[1 or views, height, width]` to mean squared differences `[views]`.
#[pyfunction]
pub(crate) fn mse_loss() -> Function {
    Function::new(Kind::Op(
        Op::elementary(ElementaryOp::Loss(PixelLoss::SquaredError)),
        &[3, 3],
        false,
    ))
}

/// Images `[views, height, width]` and targets `[1 or views, height, width]` to one less the overlap over the union, `[views]`.
#[pyfunction]
pub(crate) fn iou_loss() -> Function {
    Function::new(Kind::Op(Op::elementary(ElementaryOp::Loss(PixelLoss::Iou)), &[3, 3], false))
}

#[pymethods]
impl Function {
    /// The number under which compiled code finds the function, as long as it exists.
    #[getter]
    fn id(&self) -> i64 {
        self.0.id
    }

    /// How many axes each input has.
    #[getter]
    fn axes(&self) -> Vec<usize> {
        self.0.kind.axes().to_vec()
    }

    /// How many arrays the value leaves to the derivatives.
    #[getter]
    fn keeps(&self) -> usize {
        self.0.kind.keeps()
    }

    /// Whether all inputs have the views first and may be concatenated.
    #[getter]
    fn views(&self) -> bool {
        self.0.kind.views()
    }

    /// The results of a derivative: "value", "image", "jvp", "vjp" or "vjp_of_vjp". `arrays` are the inputs, what is kept, the upstream and the
    /// directions, as far as the derivative has them. `along` are the inputs that have a direction, `wanted` those whose gradients are returned.
    fn call<'py>(
        &self,
        py: Python<'py>,
        order: &str,
        arrays: Vec<Bound<'py, PyAny>>,
        along: Vec<bool>,
        wanted: Vec<bool>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let order = Order::named(order)?;
        let arrays: Vec<_> = arrays.iter().map(Borrowed::new).collect::<PyResult<_>>()?;
        let arrays: Vec<_> = arrays.iter().map(Borrowed::array).collect::<PyResult<_>>()?;
        let call = Call { order, along: &along, wanted: &wanted };
        let found = py.detach(|| self.0.call(&call, &arrays)).map_err(refused)?;
        found.into_iter().map(|array| array.into_numpy(py)).collect()
    }

    /// Writes the results of a derivative to `outputs`, for arrays on one device that are given as unused capsules of DLPack. All are float32, except
    /// φ and its gradient, which are float64 on the CPU. There are no further axes in front.
    fn call_dlpack<'py>(
        &self,
        py: Python<'py>,
        order: &str,
        inputs: Vec<Bound<'py, PyCapsule>>,
        outputs: Vec<Bound<'py, PyCapsule>>,
        along: Vec<bool>,
        wanted: Vec<bool>,
    ) -> PyResult<()> {
        let call = Call { order: Order::named(order)?, along: &along, wanted: &wanted };
        let inputs: Vec<_> = inputs.iter().map(Lent::new).collect::<PyResult<_>>()?;
        let outputs: Vec<_> = outputs.iter().map(Lent::new).collect::<PyResult<_>>()?;
        let work = match inputs.first().map(|first| first.device[0]) {
            Some(dlpack::CPU) => device::call::<NdArray<f32>>,
            #[cfg(feature = "cuda")]
            Some(dlpack::CUDA) => device::call::<Cuda>,
            _ => return Err(refused("softrast does not draw on the device of the arrays")),
        };
        let kind = &self.0.kind;
        py.detach(|| unwound(|| work(kind, &call, &inputs, &outputs)).flatten()).map_err(refused)
    }
}

/// Whether this wheel was built with the feature cuda.
#[pyfunction]
pub(crate) fn has_cuda() -> bool {
    cfg!(feature = "cuda")
}

impl Known {
    /// How many flags `along` and `wanted` have.
    pub(crate) fn flags(&self, order: Order) -> [usize; 2] {
        self.kind.flags(order)
    }

    /// The results of a call, by whatever framework.
    pub(crate) fn call(
        &self,
        call: &Call<'_>,
        arrays: &[Array<'_>],
    ) -> Result<Vec<Array<'static>>, String> {
        let wrong = || misfit(arrays);
        let first = arrays.first().ok_or_else(wrong)?;
        let own = first.dims.len().checked_sub(self.kind.axes()[0]).ok_or_else(wrong)?;
        let lead = &first.dims[..own];
        let scenes: usize = lead.iter().product();
        if scenes == 0 || arrays.iter().any(|array| !array.dims.starts_with(lead)) {
            return Err(wrong());
        }
        let one = |arrays: &[Array<'_>]| match first.numbers {
            Floats::F32(_) => self.kind.call::<f32>(call, arrays),
            Floats::F64(_) => self.kind.call::<f64>(call, arrays),
            Floats::Device(_) => Err(wrong()),
        };
        if own == 0 {
            return one(arrays);
        }
        if self.kind.views() {
            // All that is computed of a view is its own, so views of all scenes go through in one call.
            let joined = |array: &'_ Array<'_>| match &array.dims[own..] {
                [views, rest @ ..] => Ok([&[scenes * views][..], rest].concat()),
                [] => Err(wrong()),
            };
            let dims = arrays.iter().map(joined).collect::<Result<Vec<_>, _>>()?;
            let all: Vec<_> =
                arrays.iter().zip(dims).map(|(array, dims)| array.part(dims, 0)).collect();
            let mut found = one(&all)?;
            for array in &mut found {
                array.dims = [lead, &[array.dims[0] / scenes][..], &array.dims[1..]].concat();
            }
            return Ok(found);
        }
        let scene = |k| {
            let parts = arrays.iter().map(|array| array.part(array.dims[own..].to_vec(), k));
            one(&parts.collect::<Vec<_>>())
        };
        let mut found = scene(0)?;
        for k in 1..scenes {
            for (all, next) in found.iter_mut().zip(scene(k)?) {
                all.numbers.extend(&next.numbers);
            }
        }
        for array in &mut found {
            array.dims = [lead, &array.dims[..]].concat();
        }
        Ok(found)
    }
}
