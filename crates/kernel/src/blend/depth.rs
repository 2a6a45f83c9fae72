//! Weights of points by depth, and their derivatives.

use crate::{
    lanes::{Lanes, Places},
    real::{Float, Mask, Real, Table, everywhere, splat},
    table::{Grid, Lookup, TablePosition},
};

/// Source of the logarithm of a depth weight.
///
/// The [module](super) has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthGrid {
    /// A table of the negative logarithm over the squared distance from the near plane; nearer depths are on the outer side.
    Table(Grid),
    /// One row that holds `a` and `c`: with x = nearness - 1, the logarithm of the weight is `a x + c`, at least [`LEAST`] and at most 0.
    Exponential,
    /// One row that holds `a` and `c`: the weight is `a z` for a nearness z above 0, `-c z` below it, and at least `floor`.
    Line {
        /// The least weight.
        floor: f64,
    },
}

/// The least logarithm of an exponential weight.
pub const LEAST: f64 = -1e15;

impl DepthGrid {
    /// Rows of the table.
    pub fn rows(&self) -> usize {
        match self {
            Self::Table(grid) => grid.rows(),
            Self::Exponential | Self::Line { .. } => 1,
        }
    }
}

/// A [`DepthGrid`] prepared for look-ups, with its table.
pub(super) struct DepthLookup<'a, T: Real> {
    grid: DepthGrid,
    lookup: Option<Lookup<Float<T>>>,
    table: Table<'a, T>,
}

/// Depth weights of points.
#[derive(Clone, Copy)]
pub(super) enum DepthAt<T: Real> {
    /// From a table: the logarithm of the weight, its derivative with respect to the position, and the position in the table.
    Table { log: T, slope: T, t: T, row: Places },
    /// From an exponential: the logarithm, its derivative, the position, and the lanes where the logarithm is above and below its bounds.
    Exponential { log: T, slope: T, x: T, within: [Mask<T>; 2] },
    /// From a line: the logarithm, and the intermediates of its derivatives.
    Line { log: T, per_weight: T, nearness: T, slope: T, near: Mask<T> },
}

impl<'a, T: Real> DepthLookup<'a, T> {
    pub(super) fn new(grid: DepthGrid, table: Table<'a, T>) -> Self {
        let lookup = match &grid {
            DepthGrid::Table(grid) => Some(Lookup::new(grid, 1.0)),
            DepthGrid::Exponential | DepthGrid::Line { .. } => None,
        };
        Self { grid, lookup, table }
    }

    /// Rows of the table.
    pub(super) fn rows(&self) -> usize {
        self.grid.rows()
    }

    /// A number of the single row, in all lanes.
    #[inline(always)]
    fn number(&self, column: usize) -> T {
        let Table { values, tangents } = self.table;
        everywhere(values.as_flattened(), tangents.as_flattened(), column)
    }

    /// Depth weights of points at `x`, their nearness less 1.
    #[inline(always)]
    pub(super) fn at(&self, x: T) -> DepthAt<T> {
        let zero = splat::<T::Lanes>(0.0);
        match (&self.lookup, self.grid) {
            (Some(lookup), _) => {
                let behind = x.value().at_most(zero);
                let TablePosition { row, t, rate } = lookup.place::<T, true>(x * x, behind);
                let [value, slope] = cubic(T::rows(self.table, &row), t);
                let log = T::constant(zero) - value;
                let slope = slope.scale(rate) * x.scale(splat(-2.0));
                DepthAt::Table { log, slope, t, row }
            }
            (None, DepthGrid::Exponential) => {
                let least = splat::<T::Lanes>(LEAST);
                let slope = self.number(0);
                let log = slope * x + self.number(1);
                let within = [least.less(log.value()), log.value().less(zero)];
                let log = T::choose(within[0], log, T::constant(least)).masked(within[1]);
                let slope = slope.masked(within[0]).masked(within[1]);
                DepthAt::Exponential { log, slope, x, within }
            }
            (None, DepthGrid::Line { floor }) => {
                let nearness = x + T::constant(splat(1.0));
                let near = zero.less(nearness.value());
                let [a, c] = [self.number(0), self.number(1)];
                let slope = T::choose(near, a, T::constant(zero) - c);
                let weight = slope * nearness;
                let some = splat::<T::Lanes>(floor).less(weight.value());
                let held = T::choose(some, weight, T::constant(splat(floor)));
                let per_weight = held.inverse().masked(some);
                DepthAt::Line { log: held.logarithm(), per_weight, nearness, slope, near }
            }
            (None, DepthGrid::Table(_)) => unreachable!("a table has a look-up"),
        }
    }
}

impl<T: Real> DepthAt<T> {
    /// A placeholder before any point is known.
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        let zero = T::constant(splat(0.0));
        Self::Table { log: zero, slope: zero, t: zero, row: Places::FIRST }
    }

    /// The logarithm of the weight.
    #[inline(always)]
    pub(super) fn log(&self) -> T {
        match self {
            Self::Table { log, .. } | Self::Exponential { log, .. } | Self::Line { log, .. } => {
                *log
            }
        }
    }

    /// The derivative of the logarithm with respect to the nearness.
    #[inline(always)]
    pub(super) fn slope(&self) -> T {
        match self {
            Self::Table { slope, .. } | Self::Exponential { slope, .. } => *slope,
            Self::Line { per_weight, slope, .. } => *per_weight * *slope,
        }
    }

    /// Adds to the gradient of the table; `by_log` is the derivative with respect to the logarithm.
    #[inline(always)]
    pub(super) fn pull(&self, by_log: T, table: &mut [[Float<T>; 4]]) {
        let zero = T::constant(splat(0.0));
        match self {
            Self::Table { t, row, .. } => pull_row(zero - by_log, *t, row, table),
            Self::Exponential { x, within, .. } => {
                let by_constant = by_log.masked(within[0]).masked(within[1]);
                let by_slope = by_constant * *x;
                let columns = [by_slope.output(), by_constant.output(), splat(0.0), splat(0.0)];
                T::Lanes::add_to_rows(table, &Places::FIRST, columns);
            }
            Self::Line { per_weight, nearness, near, .. } => {
                let by_slope = by_log * *per_weight * *nearness;
                let above = by_slope.masked(*near);
                let below = above - by_slope;
                let columns = [above.output(), below.output(), splat(0.0), splat(0.0)];
                T::Lanes::add_to_rows(table, &Places::FIRST, columns);
            }
        }
    }
}

/// A cubic and its derivative at `t`. Evaluated in pairs: a chain of products would have long dependencies.
#[inline(always)]
pub(super) fn cubic<T: Real>([a, b, c, d]: [T; 4], t: T) -> [T; 2] {
    let square = t * t;
    let value = (a + t * b) + square * (c + t * d);
    let slope = (b + t * c.scale(splat(2.0))) + square * d.scale(splat(3.0));
    [value, slope]
}

/// Adds to the gradient of the rows of a table; `by_value` is the derivative with respect to the value at the position `t` in them.
#[inline(always)]
pub(super) fn pull_row<T: Real>(by_value: T, t: T, row: &Places, table: &mut [[Float<T>; 4]]) {
    let first = by_value * t;
    let second = first * t;
    let third = second * t;
    let columns = [by_value.output(), first.output(), second.output(), third.output()];
    T::Lanes::add_to_rows(table, row, columns);
}
