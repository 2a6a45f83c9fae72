//! Kinds of functions, and their results for one scene.

use std::{borrow::Borrow, sync::Arc};

use pyo3::PyResult;

use crate::{
    arrays::Array,
    guard::refused,
    losses::Losses,
    op::Op,
    passes::{Blends, Directions, Found, Inputs, MISSING, Silhouettes},
    store::{Store, View},
};

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
    /// The order of a name.
    pub(crate) fn named(name: &str) -> PyResult<Self> {
        let found = Self::ALL.into_iter().find(|(known, _)| *known == name);
        Ok(found.ok_or_else(|| refused(format!("there is no derivative {name}")))?.1)
    }

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

/// A kind of function.
pub(crate) enum Kind {
    /// An op, the numbers of axes of its inputs, and whether views may be concatenated.
    Op(Op, &'static [usize], bool),
    /// Vertices `[views, 3, V]` and, unless it is the renderer's own, φ `[P]` to coverage and the sums.
    Silhouette(Arc<Silhouettes>, bool),
    /// See [`Losses`].
    Loss(Losses),
    /// See [`Blends`].
    Blend(Box<Blends>),
}

impl Kind {
    /// How many axes each input has.
    pub(crate) fn axes(&self) -> &'static [usize] {
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

    /// How many arrays the value leaves to the derivatives.
    pub(crate) fn keeps(&self) -> usize {
        matches!(self, Self::Silhouette(..) | Self::Loss(_)).into()
    }

    /// Whether all inputs have the views first and may be concatenated.
    pub(crate) fn views(&self) -> bool {
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
    pub(crate) fn flags(&self, order: Order) -> [usize; 2] {
        let count = self.axes().len();
        match order {
            Order::Value | Order::Image => [0, 0],
            Order::Jvp => [count, 0],
            Order::Vjp => [0, count],
            Order::VjpOfVjp => [count, count + 1],
        }
    }

    /// The results for one scene.
    pub(crate) fn call<S: Store>(
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
        let place = self.phi();
        let mut given: Inputs<'_, S> = Inputs { views: Vec::new(), phi: Vec::new() };
        for (k, array) in inputs.iter().enumerate() {
            if Some(k) == place {
                given.phi = array.numbers.wide()?;
                given.views.push(given.views[0].clone());
            } else {
                given.views.push(array.view()?);
            }
        }
        let mut directions = Directions { views: inputs.iter().map(|_| None).collect(), phi: None };
        for k in (0..count).filter(|&k| call.along.get(k) == Some(&true)) {
            let Some((direction, others)) = rest.split_first() else { return Err(wrong()) };
            rest = others;
            if direction.dims != inputs[k].dims {
                return Err(wrong());
            }
            if Some(k) == place {
                directions.phi = Some(direction.numbers.wide()?);
            } else {
                directions.views[k] = Some(direction.view::<S>()?.values);
            }
        }
        let mut wanted = call.wanted.to_vec();
        if let Self::Silhouette(of, true) = self {
            // Its own φ stays as it is.
            given.phi = of.renderer.phi().to_vec();
            given.views.push(given.views[0].clone());
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
                let zeros = S::filled(0.0, dims.iter().product(), given.views[0].values);
                let upstream = View { dims: dims.clone(), values: zeros.borrow() };
                let mut wanted = vec![false; given.views.len()];
                wanted.push(true);
                let found =
                    self.vjp_of_vjp(&given, kept.as_ref(), &upstream, directions, &wanted)?;
                let moved = found.views.into_iter().last().flatten().ok_or(MISSING)?;
                return Ok(vec![Array { dims, numbers: S::floats(moved) }]);
            }
            _ => {
                let mut values = self.forward(&given, order == Order::Value)?;
                values.truncate(if order == Order::Image { 1 } else { values.len() });
                // Sums have the shape of the value, gradients of losses that of the vertices.
                let kept = if let Self::Loss(_) = self { &given.views[0].dims } else { &dims };
                let array = |(values, dims): (S::Owned, &Vec<usize>)| Array {
                    dims: dims.clone(),
                    numbers: S::floats(values),
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
                found.views[if k == count { last } else { k }].take().map(S::floats)
            };
            let numbers = numbers.ok_or(MISSING)?;
            gradients.push(Array { dims: array.dims.clone(), numbers });
        }
        Ok(gradients)
    }

    /// The shape of the value.
    fn dims<S: Store>(&self, views: &[View<'_, S>]) -> Result<Vec<usize>, String> {
        match self {
            Self::Op(op, ..) => {
                op.shape(&views.iter().map(|view| view.dims.clone()).collect::<Vec<_>>())
            }
            Self::Silhouette(of, _) => Ok(of.dims(&views[0])),
            Self::Loss(of) => of.dims(views),
            Self::Blend(of) => Ok(of.dims(views)),
        }
    }

    fn forward<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        keeps: bool,
    ) -> Result<Vec<S::Owned>, String> {
        match self {
            Self::Op(op, ..) => Ok(vec![op.forward(&inputs.views)?]),
            Self::Silhouette(of, _) => of.forward(inputs, keeps),
            Self::Loss(of) => of.forward(&inputs.views, keeps),
            Self::Blend(of) => of.forward(inputs, keeps),
        }
    }

    fn vjp<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        kept: Option<&View<'_, S>>,
        upstream: &View<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
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

    fn vjp_of_vjp<S: Store>(
        &self,
        inputs: &Inputs<'_, S>,
        kept: Option<&View<'_, S>>,
        upstream: &View<'_, S>,
        directions: Directions<'_, S>,
        wanted: &[bool],
    ) -> Result<Found<S>, String> {
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
pub(crate) fn misfit(arrays: &[Array<'_>]) -> String {
    let dims: Vec<_> = arrays.iter().map(|array| &array.dims).collect();
    format!("arrays of these shapes do not fit the function: {dims:?}")
}
