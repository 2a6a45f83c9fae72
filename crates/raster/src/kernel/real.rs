//! The numbers that kernels run on: floats, and dual numbers over floats.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Arithmetic shared by floats and dual numbers. Kernels branch on [`Real::value`] only.
pub(crate) trait Real:
    Copy
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// The float below.
    type Float: Float;
    /// The number zero.
    const ZERO: Self;
    /// The number one.
    const ONE: Self;
    /// A number that does not depend on any input.
    fn constant(value: Self::Float) -> Self;
    /// The number without its derivative.
    fn value(self) -> Self::Float;
    /// `factor * self` for a factor that does not depend on any input.
    fn scale(self, factor: Self::Float) -> Self;
    /// `1 / self`.
    fn recip(self) -> Self;
}

/// `f32` or `f64`, with the view of their bits that the profile table is indexed by.
pub(crate) trait Float: Real<Float = Self> + PartialOrd + Default + std::fmt::Debug {
    /// Nearest float.
    fn from_f64(value: f64) -> Self;
    /// To double precision.
    fn to_f64(self) -> f64;
    /// Where `self` (at least 0, below 4) lies on the piecewise logarithmic grid of a table:
    /// the cell's index (not yet limited to the table), its lower end and the inverse of its width.
    fn cell(self, octaves: u32, bits: u32) -> (i32, Self, Self);
    /// Square root.
    fn sqrt(self) -> Self;
    /// Nearest integer, for numbers in [0, 2^22].
    fn nearest(self) -> i32;
}

macro_rules! float {
    ($float:ty, $bits:ty, $mantissa:expr, $bias:expr) => {
        impl Real for $float {
            type Float = Self;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline(always)]
            fn constant(value: Self) -> Self {
                value
            }
            #[inline(always)]
            fn value(self) -> Self {
                self
            }
            #[inline(always)]
            fn scale(self, factor: Self) -> Self {
                factor * self
            }
            #[inline(always)]
            fn recip(self) -> Self {
                1.0 / self
            }
        }

        impl Float for $float {
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn cell(self, octaves: u32, bits: u32) -> (i32, Self, Self) {
                // Exponent and leading mantissa bits count the cells; what remains is the place
                // within the cell.
                let raw = self.to_bits();
                let shift = $mantissa - bits;
                let lower = Self::from_bits((raw >> shift) << shift);
                let first = ($bias - octaves) << bits;
                let index = (raw >> shift) as i32 - first as i32 + 1;
                let exponent = raw >> $mantissa;
                let inverse_width =
                    Self::from_bits((2 * $bias + bits as $bits - exponent) << $mantissa);
                (index, lower, inverse_width)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn nearest(self) -> i32 {
                // Adding 2^mantissa leaves the integer in the low bits; a cast would check its range
                // number by number.
                let shift = (1u64 << $mantissa) as Self;
                ((self + shift).to_bits() - shift.to_bits()) as i32
            }
        }
    };
}

float!(f32, u32, 23, 127);
float!(f64, u64, 52, 1023);

/// A number with its derivative along one direction of the inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Dual<F> {
    pub(crate) value: F,
    pub(crate) tangent: F,
}

impl<F: Float> Add for Dual<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, tangent: self.tangent + other.tangent }
    }
}

impl<F: Float> Sub for Dual<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, tangent: self.tangent - other.tangent }
    }
}

impl<F: Float> Mul for Dual<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            tangent: self.value * other.tangent + self.tangent * other.value,
        }
    }
}

impl<F: Float> Neg for Dual<F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, tangent: -self.tangent }
    }
}

impl<F: Float> AddAssign for Dual<F> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<F: Float> Real for Dual<F> {
    type Float = F;
    const ZERO: Self = Self { value: F::ZERO, tangent: F::ZERO };
    const ONE: Self = Self { value: F::ONE, tangent: F::ZERO };
    #[inline(always)]
    fn constant(value: F) -> Self {
        Self { value, tangent: F::ZERO }
    }
    #[inline(always)]
    fn value(self) -> F {
        self.value
    }
    #[inline(always)]
    fn scale(self, factor: F) -> Self {
        Self { value: factor * self.value, tangent: factor * self.tangent }
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let value = self.value.recip();
        Self { value, tangent: -(value * value * self.tangent) }
    }
}
