//! Functions of arrays with their derivatives, for frameworks that keep no state between the passes.

use std::{
    collections::HashMap,
    hash::{BuildHasher, RandomState},
    sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, Weak},
};

use pyo3::prelude::*;
use softrast_raster::low_level::ElementaryOp;

use crate::{
    arrays::{Array, Borrowed, Float, Floats, View},
    guard::refused,
    losses::Losses,
    op::Op,
    passes::{Blends, Directions, Found, Inputs, Silhouettes},
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

enum Kind {
    /// An op, the numbers of axes of its inputs, and whether views may be concatenated.
    Op(Op, &'static [usize], bool),
    /// Vertices `[views, 3, V]` and, unless it is the renderer's own, φ `[P]` to coverage and the sums.
    Silhouette(Arc<Silhouettes>, bool),
    /// See [`Losses`].
    Loss(Losses),
    /// See [`Blends`].
    Blend(Box<Blends>),
}

/// Which derivative of a function.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// The value and what is kept, of inputs.
    Value,
    /// The value alone, of inputs: for callers that take no derivative.
    Image,
    /// The derivative along directions, of inputs, what is kept, and the directions.
    Jvp,
    /// The gradients of `Σ upstream · value`, of inputs, what is kept, and the upstream.
    Vjp,
    /// The gradients of `Σ direction · vjp`, of inputs, what is kept, the upstream, and the directions.
    VjpOfVjp,
}

impl Order {
    /// The orders by their names.
    pub(crate) const ALL: [(&str, Self); 5] = [
        ("value", Self::Value),
        ("image", Self::Image),
        ("jvp", Self::Jvp),
        ("vjp", Self::Vjp),
        ("vjp_of_vjp", Self::VjpOfVjp),
    ];
}

/// A request: a derivative, the inputs that have a direction, and the inputs (at last the upstream) whose gradients are wanted.
pub(crate) struct Call<'a> {
    pub(crate) order: Order,
    pub(crate) along: &'a [bool],
    pub(crate) wanted: &'a [bool],
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
    Function::new(Kind::Op(Op::elementary(ElementaryOp::SquaredError), &[3, 3], false))
}

/// Images `[views, height, width]` and targets `[1 or views, height, width]` to one less the overlap over the union, `[views]`.
#[pyfunction]
pub(crate) fn iou_loss() -> Function {
    Function::new(Kind::Op(Op::elementary(ElementaryOp::Iou), &[3, 3], false))
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
        let named = Order::ALL.into_iter().find(|(name, _)| *name == order);
        let (_, order) = named.ok_or_else(|| refused(format!("there is no derivative {order}")))?;
        let arrays: Vec<_> = arrays.iter().map(Borrowed::new).collect::<PyResult<_>>()?;
        let arrays: Vec<_> = arrays.iter().map(Borrowed::array).collect::<PyResult<_>>()?;
        let call = Call { order, along: &along, wanted: &wanted };
        let found = py.detach(|| self.0.call(&call, &arrays)).map_err(refused)?;
        found.into_iter().map(|array| array.into_numpy(py)).collect()
    }
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

impl Kind {
    fn axes(&self) -> &'static [usize] {
        match self {
            Self::Op(_, axes, _) => axes,
            Self::Silhouette(_, own) => {
                if *own {
                    &[3]
                } else {
                    &[3, 1]
                }
            }
            Self::Loss(_) => &[3, 3],
            Self::Blend(of) => {
                if of.has_texture() {
                    &[3, 3, 1, 1, 2]
                } else {
                    &[3, 3, 1, 1]
                }
            }
        }
    }

    fn keeps(&self) -> usize {
        matches!(self, Self::Silhouette(..) | Self::Loss(_)).into()
    }

    fn views(&self) -> bool {
        match self {
            Self::Op(_, _, views) => *views,
            Self::Silhouette(_, own) => *own,
            Self::Loss(_) | Self::Blend(_) => false,
        }
    }

    /// The place of φ among the inputs.
    fn phi(&self) -> Option<usize> {
        match self {
            Self::Op(..) | Self::Silhouette(_, true) | Self::Loss(_) => None,
            Self::Silhouette(_, false) => Some(1),
            Self::Blend(_) => Some(Blends::PHI),
        }
    }

    /// How many flags `along` and `wanted` have.
    fn flags(&self, order: Order) -> [usize; 2] {
        let count = self.axes().len();
        match order {
            Order::Value | Order::Image => [0, 0],
            Order::Jvp => [count, 0],
            Order::Vjp => [0, count],
            Order::VjpOfVjp => [count, count + 1],
        }
    }

    /// The results for one scene.
    fn call<F: Float>(
        &self,
        call: &Call<'_>,
        arrays: &[Array<'_>],
    ) -> Result<Vec<Array<'static>>, String> {
        let (axes, order, wrong) = (self.axes(), call.order, || misfit(arrays));
        let count = axes.len();
        let keeps = self.keeps();
        let (kept, upstream) = match order {
            Order::Value | Order::Image => (0, 0),
            Order::Jvp => (keeps, 0),
            Order::Vjp | Order::VjpOfVjp => (keeps, 1),
        };
        let along = call.along.iter().filter(|&&along| along).count();
        let ranks = arrays.iter().zip(axes).all(|(array, &axes)| array.dims.len() == axes);
        let total = count + kept + upstream + along;
        if !ranks
            || arrays.len() != total
            || [call.along.len(), call.wanted.len()] != self.flags(order)
        {
            return Err(wrong());
        }
        let (inputs, rest) = arrays.split_at(count);
        let (kept, rest) = rest.split_at(kept);
        let (upstream, mut rest) = rest.split_at(upstream);
        let (place, empty) = (self.phi(), View { dims: Vec::new(), values: &[] });
        let mut given = Inputs { views: Vec::new(), phi: Vec::new() };
        for (k, array) in inputs.iter().enumerate() {
            if Some(k) == place {
                given.phi = array.numbers.wide();
            }
            given.views.push(if Some(k) == place { empty.clone() } else { array.view()? });
        }
        let mut directions = Directions { views: vec![None; count], phi: None };
        for k in (0..count).filter(|&k| call.along.get(k) == Some(&true)) {
            let Some((direction, others)) = rest.split_first() else { return Err(wrong()) };
            rest = others;
            if direction.dims != inputs[k].dims {
                return Err(wrong());
            }
            if Some(k) == place {
                directions.phi = Some(direction.numbers.wide());
            } else {
                directions.views[k] = Some(direction.view()?.values);
            }
        }
        let mut wanted = call.wanted.to_vec();
        if let Self::Silhouette(of, true) = self {
            // Its own φ stays as it is.
            given.phi = of.renderer.phi().to_vec();
            given.views.push(empty);
            directions.views.push(None);
            wanted.insert(wanted.len().min(1), false);
        }
        let kept = kept.first().map(Array::view).transpose()?;
        let like = upstream.first();
        let upstream = like.map(Array::view).transpose()?;
        let dims = self.dims(&given.views)?;
        let mut found = match (order, &upstream) {
            (Order::Vjp, Some(upstream)) => self.vjp(&given, kept.as_ref(), upstream, &wanted)?,
            (Order::VjpOfVjp, Some(upstream)) => {
                self.vjp_of_vjp(&given, kept.as_ref(), upstream, directions, &wanted)?
            }
            (Order::Jvp, _) => {
                let zeros = vec![F::from_elem(0.0); dims.iter().product()];
                let upstream = View { dims: dims.clone(), values: &zeros };
                let mut wanted = vec![false; given.views.len()];
                wanted.push(true);
                let found =
                    self.vjp_of_vjp(&given, kept.as_ref(), &upstream, directions, &wanted)?;
                let moved = found.views.into_iter().last().flatten().unwrap_or_default();
                return Ok(vec![Array { dims, numbers: F::any(moved) }]);
            }
            _ => {
                let mut values = self.forward(&given, order == Order::Value)?;
                values.truncate(if order == Order::Image { 1 } else { values.len() });
                // Sums have the shape of the value, gradients of losses that of the vertices.
                let kept = if let Self::Loss(_) = self { &given.views[0].dims } else { &dims };
                let array = |(values, dims): (Vec<F>, &Vec<usize>)| Array {
                    dims: dims.clone(),
                    numbers: F::any(values),
                };
                return Ok(values.into_iter().zip([&dims, kept]).map(array).collect());
            }
        };
        let last = found.views.len() - 1;
        let mut gradients = Vec::new();
        for (k, array) in inputs.iter().chain(like).enumerate() {
            if call.wanted.get(k) != Some(&true) {
                continue;
            }
            let numbers = if Some(k) == place {
                found.phi.take().map(|phi| array.numbers.like(phi))
            } else {
                found.views[if k == count { last } else { k }].take().map(F::any)
            };
            let numbers = numbers.ok_or("a gradient is missing")?;
            gradients.push(Array { dims: array.dims.clone(), numbers });
        }
        Ok(gradients)
    }

    /// The shape of the value.
    fn dims<F: Float>(&self, views: &[View<'_, F>]) -> Result<Vec<usize>, String> {
        match self {
            Self::Op(op, ..) => {
                op.shape(&views.iter().map(|view| view.dims.clone()).collect::<Vec<_>>())
            }
            Self::Silhouette(of, _) => Ok(of.dims(&views[0])),
            Self::Loss(of) => of.dims(views),
            Self::Blend(of) => Ok(of.dims(views)),
        }
    }

    fn forward<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        keeps: bool,
    ) -> Result<Vec<Vec<F>>, String> {
        match self {
            Self::Op(op, ..) => Ok(vec![op.forward(&inputs.views)?]),
            Self::Silhouette(of, _) => of.forward(inputs, keeps),
            Self::Loss(of) => of.forward(&inputs.views, keeps),
            Self::Blend(of) => of.forward(inputs, keeps),
        }
    }

    fn vjp<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        kept: Option<&View<'_, F>>,
        upstream: &View<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        match (self, kept) {
            (Self::Silhouette(of, _), Some(kept)) => of.vjp(inputs, kept, upstream, wanted),
            (Self::Loss(of), Some(kept)) => {
                Ok(Found { views: of.vjp(&inputs.views, kept, upstream, wanted)?, phi: None })
            }
            (Self::Blend(of), _) => of.vjp(inputs, upstream, wanted),
            (Self::Op(op, ..), _) => {
                Ok(Found { views: op.vjp(&inputs.views, upstream, wanted)?, phi: None })
            }
            _ => Err("what is kept is missing".to_owned()),
        }
    }

    fn vjp_of_vjp<F: Float>(
        &self,
        inputs: &Inputs<'_, F>,
        kept: Option<&View<'_, F>>,
        upstream: &View<'_, F>,
        directions: Directions<'_, F>,
        wanted: &[bool],
    ) -> Result<Found<F>, String> {
        match (self, kept) {
            (Self::Silhouette(of, _), Some(kept)) => {
                of.vjp_of_vjp(inputs, kept, upstream, directions, wanted)
            }
            (Self::Loss(of), _) => {
                let views = of.vjp_of_vjp(&inputs.views, upstream, &directions.views, wanted)?;
                Ok(Found { views, phi: None })
            }
            (Self::Blend(of), _) => of.vjp_of_vjp(inputs, upstream, &directions, wanted),
            (Self::Op(op, ..), _) => {
                let views = op.vjp_of_vjp(&inputs.views, upstream, &directions.views, wanted)?;
                Ok(Found { views, phi: None })
            }
            _ => Err("what is kept is missing".to_owned()),
        }
    }
}

/// An error that names the shapes of a call.
fn misfit(arrays: &[Array<'_>]) -> String {
    let dims: Vec<_> = arrays.iter().map(|array| &array.dims).collect();
    format!("arrays of these shapes do not fit the function: {dims:?}")
}
