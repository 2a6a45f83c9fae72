//! Dual numbers in kernels: one source for the formulas of a pass and of its derivative.
//!
//! All kernels compute with them. If a pass stores only values, the tangents are unused and the driver's compiler removes them, so the
//! first order has no overhead.

use cubecl::prelude::*;

/// A number with its derivative along one direction of the inputs.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Dual {
    pub(super) value: f32,
    pub(super) tangent: f32,
}

#[cube]
impl Dual {
    /// A number that does not depend on any input.
    pub(super) fn constant(value: f32) -> Dual {
        Dual { value, tangent: 0.0f32 }
    }

    pub(super) fn add(self, other: Dual) -> Dual {
        Dual { value: self.value + other.value, tangent: self.tangent + other.tangent }
    }

    pub(super) fn sub(self, other: Dual) -> Dual {
        Dual { value: self.value - other.value, tangent: self.tangent - other.tangent }
    }

    pub(super) fn mul(self, other: Dual) -> Dual {
        Dual {
            value: self.value * other.value,
            tangent: self.value * other.tangent + self.tangent * other.value,
        }
    }

    /// `factor * self` for a factor that does not depend on any input.
    pub(super) fn scale(self, factor: f32) -> Dual {
        Dual { value: factor * self.value, tangent: factor * self.tangent }
    }

    /// `1 / self`.
    pub(super) fn recip(self) -> Dual {
        let value = 1.0f32 / self.value;
        Dual { value, tangent: -(value * value * self.tangent) }
    }

    /// `exp(self)`.
    pub(super) fn exp(self) -> Dual {
        let value = f32::exp(self.value);
        Dual { value, tangent: value * self.tangent }
    }

    /// The natural logarithm.
    pub(super) fn ln(self) -> Dual {
        Dual { value: f32::ln(self.value), tangent: self.tangent / self.value }
    }

    /// `yes` where `condition` holds, else `no`.
    pub(super) fn select(condition: bool, yes: Dual, no: Dual) -> Dual {
        Dual {
            value: select(condition, yes.value, no.value),
            tangent: select(condition, yes.tangent, no.tangent),
        }
    }

    /// The number that a pass stores: the derivative in a pass of second order, else the value.
    pub(super) fn stored(self, #[comptime] second: bool) -> f32 {
        if second { self.tangent } else { self.value }
    }
}

/// Number `index` of `values`, with its derivative if the pass is of second order.
#[cube]
pub(super) fn load(
    values: &Array<f32>,
    index: usize,
    tangents: &Array<f32>,
    tangent_index: usize,
    #[comptime] second: bool,
) -> Dual {
    let value = values[index];
    if second { Dual { value, tangent: tangents[tangent_index] } } else { Dual::constant(value) }
}
