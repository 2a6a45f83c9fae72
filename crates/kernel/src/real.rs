//! The numbers that kernels run on: vectors of floats, and dual numbers over them.

use std::ops::{Add, Mul, Sub};

use super::{
    float::Float as _,
    lanes::{LANES, Lanes, Places},
};

/// Arithmetic shared by vectors and dual numbers over them. Kernels compare [`Real::value`] only.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// The vectors below.
    type Lanes: Lanes;
    /// One number of each edge or corner of [`LANES`] faces, in memory.
    type Threes: Copy + Default;
    /// Whether numbers have tangents. Then a kernel returns the tangents.
    const DUAL: bool;
    /// Numbers with these tangents, which are ignored by types without tangents.
    fn new(value: Self::Lanes, tangent: Self::Lanes) -> Self;
    /// Numbers that do not depend on any input.
    fn constant(value: Self::Lanes) -> Self;
    /// The values without their derivatives.
    fn value(self) -> Self::Lanes;
    /// The part of a result that a kernel returns: the derivatives if there are any, else the values.
    fn output(self) -> Self::Lanes;
    /// `factor * self` for a factor that does not depend on any input.
    fn scale(self, factor: Self::Lanes) -> Self;
    /// `1 / self`.
    fn inverse(self) -> Self;
    /// `e` to this power.
    fn exponential(self) -> Self;
    /// `e` to this power, computed by [`Lanes::power`].
    fn power_of_e(self) -> Self;
    /// Natural logarithm.
    fn logarithm(self) -> Self;
    /// `yes` where the mask holds, else `no`.
    fn choose(mask: Mask<Self>, yes: Self, no: Self) -> Self;
    /// `self` where the mask holds, else 0.
    fn masked(self, mask: Mask<Self>) -> Self;
    /// Clamped to [0, 1].
    fn clamped(self) -> Self;
    /// Writes the numbers of each lane.
    fn write_threes(columns: [Self; 3], to: &mut Self::Threes);
    /// Number `k` of lane `lane`, in all lanes.
    fn of_three(threes: &Self::Threes, lane: usize, k: usize) -> Self;
    /// One of the three numbers of lane `lane`, selected in each lane.
    fn chosen(threes: &Self::Threes, lane: usize, which: Which<Self>) -> Self;
    /// Rows of a table, column by column. `tangents` are used by dual numbers only.
    fn rows(table: Table<Self>, at: &Places) -> [Self; 4];
}

/// One float of a [`Real`].
pub(crate) type Float<T> = <<T as Real>::Lanes as Lanes>::Float;
/// Lane-wise condition of a [`Real`].
pub(crate) type Mask<T> = <<T as Real>::Lanes as Lanes>::Mask;
/// Selection of one of three numbers in each lane of a [`Real`].
pub(crate) type Which<T> = <<T as Real>::Lanes as Lanes>::Which;

/// Rows of a profile table, and their tangents if the numbers have any.
pub(crate) struct Table<'a, T: Real> {
    pub(crate) values: &'a [[Float<T>; 4]],
    pub(crate) tangents: &'a [[Float<T>; 4]],
}

/// A number and its tangent in all lanes.
#[inline(always)]
pub(crate) fn everywhere<T: Real>(values: &[Float<T>], tangents: &[Float<T>], at: usize) -> T {
    let tangent = if T::DUAL { tangents[at] } else { Float::<T>::ZERO };
    T::new(T::Lanes::splat(values[at]), T::Lanes::splat(tangent))
}

impl<T: Real> Clone for Table<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Real> Copy for Table<'_, T> {}

impl<L: Lanes> Real for L {
    type Lanes = L;
    type Threes = [[L::Float; 4]; LANES];
    const DUAL: bool = false;
    #[inline(always)]
    fn new(value: L, _: L) -> Self {
        value
    }
    #[inline(always)]
    fn constant(value: L) -> Self {
        value
    }
    #[inline(always)]
    fn value(self) -> L {
        self
    }
    #[inline(always)]
    fn output(self) -> L {
        self
    }
    #[inline(always)]
    fn scale(self, factor: L) -> Self {
        factor * self
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        Lanes::recip(self)
    }
    #[inline(always)]
    fn exponential(self) -> Self {
        Lanes::exp(self)
    }
    #[inline(always)]
    fn power_of_e(self) -> Self {
        Lanes::power(self)
    }
    #[inline(always)]
    fn logarithm(self) -> Self {
        Lanes::ln(self)
    }
    #[inline(always)]
    fn choose(mask: L::Mask, yes: L, no: L) -> Self {
        L::pick(mask, yes, no)
    }
    #[inline(always)]
    fn masked(self, mask: L::Mask) -> Self {
        Lanes::only(self, mask)
    }
    #[inline(always)]
    fn clamped(self) -> Self {
        self.max(splat(0.0)).min(splat(1.0))
    }
    #[inline(always)]
    fn write_threes(columns: [L; 3], to: &mut Self::Threes) {
        L::to_rows(columns, to);
    }
    #[inline(always)]
    fn of_three(threes: &Self::Threes, lane: usize, k: usize) -> Self {
        L::splat(threes[lane % LANES][k % 4])
    }
    #[inline(always)]
    fn chosen(threes: &Self::Threes, lane: usize, which: L::Which) -> Self {
        <L as Lanes>::chosen(&threes[lane % LANES], which)
    }
    #[inline(always)]
    fn rows(table: Table<Self>, at: &Places) -> [Self; 4] {
        L::rows(table.values, at)
    }
}

/// Numbers with their derivatives along one direction of the inputs.
///
/// ```
/// use softrast_kernel::Dual;
///
/// // x² + x and its derivative at 3.
/// let x = Dual { value: 3.0, tangent: 1.0 };
/// let y = x * x + x;
/// assert_eq!((y.value, y.tangent), (12.0, 7.0));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Dual<L> {
    /// The number.
    pub value: L,
    /// Its derivative.
    pub tangent: L,
}

impl<L: Add<Output = L>> Add for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, tangent: self.tangent + other.tangent }
    }
}

impl<L: Sub<Output = L>> Sub for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, tangent: self.tangent - other.tangent }
    }
}

impl<L: Copy + Add<Output = L> + Mul<Output = L>> Mul for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            tangent: self.value * other.tangent + self.tangent * other.value,
        }
    }
}

impl<L: Lanes> Real for Dual<L> {
    type Lanes = L;
    type Threes = Dual<[[L::Float; 4]; LANES]>;
    const DUAL: bool = true;
    #[inline(always)]
    fn new(value: L, tangent: L) -> Self {
        Self { value, tangent }
    }
    #[inline(always)]
    fn constant(value: L) -> Self {
        Self { value, tangent: splat(0.0) }
    }
    #[inline(always)]
    fn value(self) -> L {
        self.value
    }
    #[inline(always)]
    fn output(self) -> L {
        self.tangent
    }
    #[inline(always)]
    fn scale(self, factor: L) -> Self {
        Self { value: factor * self.value, tangent: factor * self.tangent }
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        let value = Lanes::recip(self.value);
        Self { value, tangent: (value * value * self.tangent).neg() }
    }
    #[inline(always)]
    fn exponential(self) -> Self {
        let value = Lanes::exp(self.value);
        Self { value, tangent: value * self.tangent }
    }
    #[inline(always)]
    fn power_of_e(self) -> Self {
        let value = Lanes::power(self.value);
        Self { value, tangent: value * self.tangent }
    }
    #[inline(always)]
    fn logarithm(self) -> Self {
        Self { value: Lanes::ln(self.value), tangent: self.tangent * Lanes::recip(self.value) }
    }
    #[inline(always)]
    fn choose(mask: L::Mask, yes: Self, no: Self) -> Self {
        Self {
            value: L::pick(mask, yes.value, no.value),
            tangent: L::pick(mask, yes.tangent, no.tangent),
        }
    }
    #[inline(always)]
    fn masked(self, mask: L::Mask) -> Self {
        Self { value: self.value.only(mask), tangent: self.tangent.only(mask) }
    }
    #[inline(always)]
    fn clamped(self) -> Self {
        let tangent = self.tangent.only(splat::<L>(0.0).less(self.value));
        let tangent = tangent.only(self.value.less(splat(1.0)));
        Self { value: self.value.clamped(), tangent }
    }
    #[inline(always)]
    fn write_threes([a, b, c]: [Self; 3], to: &mut Self::Threes) {
        L::to_rows([a.value, b.value, c.value], &mut to.value);
        L::to_rows([a.tangent, b.tangent, c.tangent], &mut to.tangent);
    }
    #[inline(always)]
    fn of_three(threes: &Self::Threes, lane: usize, k: usize) -> Self {
        Self {
            value: L::splat(threes.value[lane % LANES][k % 4]),
            tangent: L::splat(threes.tangent[lane % LANES][k % 4]),
        }
    }
    #[inline(always)]
    fn chosen(threes: &Self::Threes, lane: usize, which: L::Which) -> Self {
        Self {
            value: L::chosen(&threes.value[lane % LANES], which),
            tangent: L::chosen(&threes.tangent[lane % LANES], which),
        }
    }
    #[inline(always)]
    fn rows(table: Table<Self>, at: &Places) -> [Self; 4] {
        let [a, b, c, d] = L::rows(table.values, at);
        let [da, db, dc, dd] = L::rows(table.tangents, at);
        [
            Self { value: a, tangent: da },
            Self { value: b, tangent: db },
            Self { value: c, tangent: dc },
            Self { value: d, tangent: dd },
        ]
    }
}

/// The constant `value` in all lanes.
#[inline(always)]
pub(crate) fn splat<L: Lanes>(value: f64) -> L {
    L::splat(super::float::Float::from_f64(value))
}
