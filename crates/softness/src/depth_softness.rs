use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use softrast_tensor::{Backend, Tensor};

use crate::{
    EdgeSoftness, Family, OPAQUE, Softness, initial_mlp,
    network::{WEIGHTS, weights},
};

/// Depth softness, the weight of a face as a function of its depth: a family, or a network.
///
/// Its argument is the nearness of a face, which is 1 at the near plane and 0 at the far plane. A family is evaluated at
/// `x = nearness - 1`: it decreases behind the near plane as it does outside an edge. The network is evaluated at the nearness itself.
///
/// Source: Wu et al. 2024, Eq. 3 and 4. Not in the paper: the position of a family's edge. The released code has it at nearness 0, where
/// the reversed families are 1 for every face and narrow ones saturate, so that depths are not distinguished.
///
/// ```
/// use softrast_softness::{DepthSoftness, UnknownDepthSoftness};
/// use softrast_tensor::{NdArray, numbers, vector};
///
/// let exp: DepthSoftness = "exp".parse()?;
/// let phi = vector::<NdArray>(&exp.default_phi(0.25));
/// // A quarter of the distance between the planes divides the weight by e.
/// let log = numbers(exp.log_weight(phi, vector(&[0.75, 0.5])));
/// assert!((log[0] - log[1] - 1.0).abs() < 1e-6);
/// assert_eq!("depth_mlp".parse(), Ok(DepthSoftness::Mlp));
/// # Ok::<(), UnknownDepthSoftness>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum DepthSoftness {
    /// A family, in units of the distance between the planes.
    Family(Family),
    /// `f(z) = W5 relu(h + W4 relu(W3 relu(W2 h)))` with `h = relu(W1 z)`; φ `[56]` is laid out as
    /// for [`Mlp`](crate::families::Mlp).
    ///
    /// Without biases it is a straight line on each side of 0, `f(z) = f(1) z` for z >= 0: 56 weights, one degree of freedom. It is
    /// constant where all units of a layer are off.
    Mlp,
}

/// No depth softness has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown depth softness {found:?}; known are {} and {}",
    Family::ALL.map(Family::name).join(", "),
    DepthSoftness::Mlp.name()
)]
pub struct UnknownDepthSoftness {
    /// The requested name.
    pub found: String,
}

impl DepthSoftness {
    /// The name in files and on the command line: the name of the family, or `depth_mlp`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Family(family) => family.name(),
            Self::Mlp => "depth_mlp",
        }
    }

    /// Length of φ.
    pub fn parameters(self) -> usize {
        match self {
            Self::Family(family) => family.parameters(),
            Self::Mlp => WEIGHTS,
        }
    }

    /// Initial parameters: for a family those at `scale`, in units of the distance between the planes; for the network, which has no scale,
    /// positive weights for which a face at the near plane has weight 1.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    pub fn default_phi(self, scale: f64) -> Vec<f64> {
        match self {
            Self::Family(family) => family.default_phi(scale),
            Self::Mlp => initial_mlp(0, 1.0),
        }
    }

    /// Logarithm of the weight of faces at `nearness`, same shape; φ is `[parameters]`.
    ///
    /// Network weights are clamped to at least [`OPAQUE`], where the logarithm is constant: the network may return 0 or less.
    pub fn log_weight<B: Backend, const D: usize>(
        self,
        phi: Tensor<B, 1>,
        nearness: Tensor<B, D>,
    ) -> Tensor<B, D> {
        match self {
            Self::Family(family) => {
                let softness = EdgeSoftness::new(family);
                softness.log_value(phi, nearness - 1.0)
            }
            Self::Mlp => network(&phi, nearness).clamp_min(OPAQUE).log(),
        }
    }

    /// Values of the network at nearness 1 and -1, `[2]`, before the clamp to [`OPAQUE`]: they determine the network completely.
    pub fn mlp_at_ends<B: Backend>(phi: Tensor<B, 1>) -> Tensor<B, 1> {
        let ends = Tensor::from_data([1.0, -1.0], (&phi.device(), phi.dtype()));
        network(&phi, ends)
    }

    /// Number of leading parameters that are logarithms; 0 for the network.
    pub fn logarithms(self) -> usize {
        match self {
            Self::Family(family) => family.logarithms(),
            Self::Mlp => 0,
        }
    }
}

/// The network of [`DepthSoftness::Mlp`], same shape as `z`.
fn network<B: Backend, const D: usize>(phi: &Tensor<B, 1>, z: Tensor<B, D>) -> Tensor<B, D> {
    // With derivative 0 at 0.
    fn relu<B: Backend>(h: Tensor<B, 2>) -> Tensor<B, 2> {
        let off = h.clone().lower_equal_elem(0.0);
        h.mask_fill(off, 0.0)
    }
    let shape = z.dims();
    let [w1, w2, w3, w4, w5] = weights(phi);
    let h1 = relu(z.reshape([-1, 1]) * w1);
    let h2 = relu(h1.clone().matmul(w2));
    let h3 = relu(h2.matmul(w3));
    relu(h1 + h3.matmul(w4)).matmul(w5).reshape(shape)
}

impl fmt::Display for DepthSoftness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for DepthSoftness {
    type Err = UnknownDepthSoftness;

    fn from_str(name: &str) -> Result<Self, UnknownDepthSoftness> {
        if name == Self::Mlp.name() {
            return Ok(Self::Mlp);
        }
        let unknown = |_| UnknownDepthSoftness { found: name.to_owned() };
        name.parse().map(Self::Family).map_err(unknown)
    }
}

impl From<DepthSoftness> for String {
    fn from(softness: DepthSoftness) -> Self {
        softness.name().to_owned()
    }
}

impl TryFrom<String> for DepthSoftness {
    type Error = UnknownDepthSoftness;

    fn try_from(name: String) -> Result<Self, UnknownDepthSoftness> {
        name.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_between_files_and_the_command_line() {
        for softness in [DepthSoftness::Family(Family::GumbelMin), DepthSoftness::Mlp] {
            let json = serde_json::to_value(softness).unwrap();
            assert_eq!(json, softness.to_string());
            assert_eq!(softness.name().parse(), Ok(softness));
            assert_eq!(softness.default_phi(0.1).len(), softness.parameters());
        }
        let message = "deep".parse::<DepthSoftness>().unwrap_err().to_string();
        assert!(message.contains("known are logistic, bilogit, "), "{message}");
        assert!(message.ends_with(" and depth_mlp"), "{message}");
    }
}
