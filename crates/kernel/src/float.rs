//! The floats that kernels run on.

use super::lanes::plain::Plain;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use super::lanes::wasm::F32x8;
#[cfg(target_arch = "x86_64")]
use super::lanes::x86::F32x8;
pub(crate) use super::lanes::{Float, Vectors};

/// The best vectors of `f32`, for machines that [have them](super::lanes::has_vectors).
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128"))))]
type F32x8 = Plain<f32>;

/// A call of a function that is generic over vectors: those of this machine for a float type `F`, or arrays if it has none.
macro_rules! on_vectors {
    ($function:ident::<Dual<$float:ident>>($($argument:expr),*)) => {
        if $crate::lanes::has_vectors() {
            $function::<Dual<$float::Best>>($($argument),*)
        } else {
            $function::<Dual<$crate::lanes::Plain<$float>>>($($argument),*)
        }
    };
    ($function:ident::<$float:ident>($($argument:expr),*)) => {
        if $crate::lanes::has_vectors() {
            $function::<$float::Best>($($argument),*)
        } else {
            $function::<$crate::lanes::Plain<$float>>($($argument),*)
        }
    };
}
pub(crate) use on_vectors;

macro_rules! float {
    ($float:ty, $bits:ty, $mantissa:expr, $bias:expr, $best:ty, $exp:path, $power:path) => {
        impl Vectors for $float {
            type Best = $best;
        }

        impl Float for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }
            #[inline(always)]
            fn of_whole(value: i32) -> Self {
                value as Self
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn cell(self, octaves: u32, bits: u32) -> (i32, Self, Self) {
                // Exponent and leading mantissa bits count the cells; the remaining bits are the position within the cell.
                let raw = self.to_bits();
                let first = ($bias - octaves) << bits;
                let index = ((raw >> ($mantissa - bits)) as i32).wrapping_sub(first as i32);
                let one = (1.0 as Self).to_bits();
                let rest = (raw << bits) & ((1 << $mantissa) - 1);
                let place = Self::from_bits(rest | one) - 1.0;
                let exponent = (2 * $bias + bits as $bits).wrapping_sub(raw >> $mantissa);
                let inverse_width = Self::from_bits(exponent << $mantissa);
                (index, place, inverse_width)
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
            #[inline(always)]
            fn rounded(self) -> Self {
                // 1.5 * 2^mantissa leaves no room for a fraction.
                let shift = (3u64 << ($mantissa - 1)) as Self;
                self + shift - shift
            }
            #[inline(always)]
            fn exp(self) -> Self {
                $exp(self)
            }
            #[inline(always)]
            fn power(self) -> Self {
                $power(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                self.ln()
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                self.sin_cos()
            }
        }
    };
}

float!(f32, u32, 23, 127, F32x8, exp, power);
float!(f64, u64, 52, 1023, Plain<f64>, f64::exp, f64::exp);

/// `e^x` without a branch or a call, so that loops over it are vectorized; accurate to 2 units in the last place. Underflows to 0,
/// overflows to infinity, and keeps NaN.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Beyond these bounds the result is 0 or infinite; NaN stays.
    let held = if x < -104.0 { -104.0 } else { x };
    let held = if held > 89.0 { 89.0 } else { held };
    // Adding this leaves the nearest whole number in the low bits.
    const MAGIC: f32 = 12_582_912.0;
    let shifted = held * std::f32::consts::LOG2_E + MAGIC;
    let whole = shifted - MAGIC;
    // ln 2 in two parts, the first of which has bits to spare.
    let rest = held - whole * 0.693_359_4 + whole * 2.121_944_4e-4;
    // Evaluated in pairs, and pairs of pairs: a chain of products would have long dependencies.
    let square = rest * rest;
    let low = rest + square * (0.5 + rest * (1.0 / 6.0));
    let high = (1.0 / 24.0 + rest * (1.0 / 120.0)) + square * (1.0 / 720.0 + rest * (1.0 / 5040.0));
    let power = 1.0 + (low + square * square * high);
    // 2^whole as two factors, since one factor would leave the range of exponents.
    let exponent = shifted.to_bits().wrapping_sub(MAGIC.to_bits()) as i32;
    let half = exponent >> 1;
    let two_to = |n: i32| f32::from_bits(((n + 127) << 23) as u32);
    power * two_to(half) * two_to(exponent - half)
}

/// `e^x` for `x` up to 88, with a relative error of at most 1.2e-7 (1 + |x|) and two thirds of the steps of [`exp`]; 0 below -87.34, so
/// that no result is denormal. Unspecified beyond 88; NaN stays.
#[inline(always)]
fn power(x: f32) -> f32 {
    let binary = x * std::f32::consts::LOG2_E;
    let held = if binary < -126.0 { -126.0 } else { binary };
    const MAGIC: f32 = 12_582_912.0;
    let shifted = held + MAGIC;
    let rest = held - (shifted - MAGIC);
    // 2^rest in pairs, and pairs of pairs.
    let square = rest * rest;
    let low = rest * LN_2[0] + square * (LN_2[1] + rest * LN_2[2]);
    let high = (LN_2[3] + rest * LN_2[4]) + square * (LN_2[5] + rest * LN_2[6]);
    let power = 1.0 + (low + square * square * high);
    let power = power * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
    if binary < -126.0 { 0.0 } else { power }
}

/// `(ln 2)^n / n!` from n = 1.
const LN_2: [f32; 7] = [
    std::f32::consts::LN_2,
    0.240_226_5,
    0.055_504_11,
    0.009_618_129,
    0.001_333_355_8,
    0.000_154_035_3,
    0.000_015_252_734,
];

#[cfg(test)]
mod tests {
    use super::{exp, power};

    #[test]
    fn the_power_has_a_relative_error_of_1_2e_7_times_one_more_than_the_exponent() {
        for k in -870_000..880_000 {
            let x = k as f32 * 1e-4;
            let (found, exact) = (f64::from(power(x)), f64::from(x).exp());
            let bound = exact * (1.0 + f64::from(x).abs()) * 1.2e-7;
            assert!((found - exact).abs() <= bound, "e^{x}: {found:e} instead of {exact:e}");
        }
        assert_eq!(power(0.0), 1.0);
        assert_eq!([power(-1e30), power(f32::NEG_INFINITY), power(-87.34)], [0.0; 3]);
        assert!(power(f32::NAN).is_nan());
    }

    #[test]
    fn the_exponential_is_right_to_two_units_in_the_last_place() {
        // The last number whose exponential is finite is 88.7228.
        for k in -1_040_000..887_229 {
            let x = k as f32 * 1e-4;
            let (found, exact) = (f64::from(exp(x)), f64::from(x).exp());
            // Denormal numbers have fewer digits.
            let unit = (exact * f64::from(f32::EPSILON)).max(f64::from(f32::from_bits(1)));
            assert!((found - exact).abs() <= 2.0 * unit, "e^{x}: {found:e} instead of {exact:e}");
        }
        assert_eq!([exp(f32::NEG_INFINITY), exp(-200.0), exp(0.0)], [0.0, 0.0, 1.0]);
        assert!(
            exp(f32::INFINITY).is_infinite() && exp(88.73).is_infinite() && exp(f32::NAN).is_nan()
        );
    }
}
