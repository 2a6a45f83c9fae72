use std::ops::{Add, Mul, Sub};

use softrast_kernel::{Dual, Float};

/// A number type of the small ops: a float, or a float with its derivative along a direction.
pub(crate) trait Number:
    Copy + Send + Sync + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    type Float: Float;
    /// A number that depends on no input.
    fn constant(value: Self::Float) -> Self;
    /// The value without its derivative.
    fn value(self) -> Self::Float;
    /// `factor * self` for a factor that depends on no input.
    fn scale(self, factor: Self::Float) -> Self;
    /// `1 / self`.
    fn recip(self) -> Self;
    /// `e` to this power.
    fn exp(self) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);

    /// A constant.
    fn of(value: f64) -> Self {
        Self::constant(Self::Float::from_f64(value))
    }
    /// Clamped to the range from `low` to `high`; beyond it depends on no input. NaN stays.
    fn held(self, low: f64, high: f64) -> Self {
        let [least, most] = [low, high].map(Self::Float::from_f64);
        if self.value() < least {
            Self::constant(least)
        } else if self.value() > most {
            Self::constant(most)
        } else {
            self
        }
    }
}

macro_rules! number {
    ($float:ty) => {
        impl Number for $float {
            type Float = Self;
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
            #[inline(always)]
            fn exp(self) -> Self {
                Float::exp(self)
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                Float::sin_cos(self)
            }
        }
    };
}

number!(f32);
number!(f64);

impl<N: Number> Number for Dual<N> {
    type Float = N::Float;
    #[inline(always)]
    fn constant(value: N::Float) -> Self {
        Self { value: N::constant(value), tangent: N::of(0.0) }
    }
    #[inline(always)]
    fn value(self) -> N::Float {
        self.value.value()
    }
    #[inline(always)]
    fn scale(self, factor: N::Float) -> Self {
        Self { value: self.value.scale(factor), tangent: self.tangent.scale(factor) }
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let value = self.value.recip();
        Self { value, tangent: N::of(0.0) - value * value * self.tangent }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.value.exp();
        Self { value, tangent: value * self.tangent }
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        let minus = N::of(0.0) - sin;
        (
            Self { value: sin, tangent: cos * self.tangent },
            Self { value: cos, tangent: minus * self.tangent },
        )
    }
}
