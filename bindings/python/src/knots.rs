//! Knots of the latest φ, and ops of the latest calls.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

use crate::{
    arrays::{Array, same},
    guard::caught,
    op::Op,
    store::{Store, View},
    taped::Taped,
};

/// Knots stay while no parameter of a softness has moved by more than this. Terms at a fixed distance then move by less than the rounding,
/// 1e-3 of the tolerance, with which knots are chosen: a culled term is exp(-x) with x below 40.
const HELD: f64 = 2e-5;
/// Parameters whose tables are kept.
const DRAWINGS: usize = 64;
/// Calls whose findings are kept for the passes back: 20 bytes a face and view for silhouettes, 20 a pixel more for colours.
const RECENT: usize = 8;

/// The op that draws with some knots, and the function from φ to its table.
pub(crate) struct Knots {
    pub(crate) op: Op,
    pub(crate) tables: Taped,
    /// Rows of the table.
    pub(crate) rows: usize,
}

/// Knots, a φ and its table.
pub(crate) struct Drawing {
    pub(crate) knots: Arc<Knots>,
    pub(crate) phi: Vec<f64>,
    table: Vec<f64>,
}

impl Drawing {
    pub(crate) fn new(knots: Arc<Knots>, phi: &[f64]) -> Result<Self, String> {
        let table = caught(|| knots.tables.forward(phi))?;
        Ok(Self { knots, phi: phi.to_vec(), table })
    }

    /// The table `[rows, 4]`, in the place of other numbers.
    pub(crate) fn table<S: Store>(&self, beside: &S::Slice) -> S::Owned {
        S::narrow(&self.table, beside)
    }

    /// The gradient to φ of that to the table.
    pub(crate) fn to_phi(&self, to_table: &[f64]) -> Result<Vec<f64>, String> {
        caught(|| self.knots.tables.vjp(&self.phi, to_table))
    }
}

/// The latest drawings, by the values that knots follow: φ, and a few others behind it.
///
/// Values that are within [`HELD`] of those that knots were chosen for have the same knots, so that images are smooth there.
#[derive(Default)]
pub(crate) struct Drawings(Mutex<Latest>);

#[derive(Default)]
struct Latest {
    drawings: VecDeque<(Vec<f64>, Arc<Drawing>)>,
    /// One set of knots is enough: the others can be chosen again.
    chosen: Option<(Vec<f64>, Arc<Knots>)>,
}

impl Drawings {
    /// The drawing for φ; `choose` chooses new knots.
    ///
    /// To be called outside the pool of threads: they would wait for the lock in the middle of the work that it is held for.
    pub(crate) fn drawing(
        &self,
        phi: &[f64],
        others: &[f64],
        choose: impl FnOnce() -> Result<Knots, String>,
    ) -> Result<Arc<Drawing>, String> {
        let values = [phi, others].concat();
        let mut latest = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = latest.drawings.iter().find(|(known, _)| same(known, &values)) {
            return Ok(found.clone());
        }
        let near = |(chosen, _): &&(Vec<f64>, _)| {
            let mut pairs = chosen.iter().zip(&values);
            chosen.len() == values.len() && pairs.all(|(a, b)| (a - b).abs() <= HELD)
        };
        let knots = match latest.chosen.as_ref().filter(near) {
            Some((_, knots)) => knots.clone(),
            None => {
                let knots = Arc::new(choose()?);
                latest.chosen = Some((values.clone(), knots.clone()));
                knots
            }
        };
        let drawing = Arc::new(Drawing::new(knots, phi)?);
        if latest.drawings.len() == DRAWINGS {
            latest.drawings.pop_front();
        }
        latest.drawings.push_back((values, drawing.clone()));
        Ok(drawing)
    }
}

/// Ops of the latest calls, each with what it found out about its inputs: the passes back of a call need not find it again.
///
/// A call is recognised by the numbers of its inputs, so that nothing but time depends on what is kept.
#[derive(Default)]
pub(crate) struct Recent(Mutex<VecDeque<Call>>);

struct Call {
    of: Op,
    inputs: Vec<Array<'static>>,
    op: Op,
}

impl Recent {
    /// The op of the call of `of` with these inputs: an earlier one, or a new one. On a device nothing is kept: reading the numbers takes longer.
    pub(crate) fn op<S: Store>(&self, of: &Op, inputs: &[View<'_, S>]) -> Op {
        if !S::ON_HOST {
            return of.clone();
        }
        let known = |(input, known): (&View<'_, S>, &Array<'_>)| {
            let values = S::known(&known.numbers);
            input.dims == known.dims && values.is_some_and(|values| S::same(values, input.values))
        };
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = |call: &&Call| call.of.is(of) && inputs.iter().zip(&call.inputs).all(known);
        if let Some(call) = lock().iter().rev().find(found) {
            return call.op.clone();
        }
        let op = of.keeping();
        // Copies: callers may write to their arrays.
        let copy = |view: &View<'_, S>| Array {
            dims: view.dims.clone(),
            numbers: S::floats(view.values.to_owned()),
        };
        let call = Call { of: of.clone(), inputs: inputs.iter().map(copy).collect(), op };
        let op = call.op.clone();
        let mut calls = lock();
        if calls.len() == RECENT {
            calls.pop_front();
        }
        calls.push_back(call);
        op
    }
}
