//! The families of soft steps, one per file. [`Family`](crate::Family) selects one by name.
//!
//! ```
//! use softrast_softness::{Softness, families::*};
//! use softrast_tensor::{NdArray, numbers, vector};
//!
//! /// The coverage at a distance, for scale 1.
//! fn at(softness: impl Softness, x: f64) -> f64 {
//!     let phi = vector::<NdArray>(&softness.default_phi(1.0));
//!     numbers(softness.value(phi, vector(&[x])))[0]
//! }
//! let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a}, not {b}");
//!
//! // Symmetric families cover one half at the edge.
//! let halves = [at(Uniform, 0.0), at(CubicHermite, 0.0), at(Wigner, 0.0), at(Laplace, 0.0), at(Bilogit, 0.0), at(Mlp, 0.0)];
//! halves.into_iter().for_each(|half| near(half, 0.5));
//! // Tails end, or decrease exponentially or like 1 / |x|.
//! assert!(at(Uniform, -9.0) == 0.0 && at(Gudermannian, -9.0) < 1e-3 && at(Reciprocal, -9.0) > 1e-2);
//! // Reversed laws are 1 inside; the two Gumbel laws mirror one another.
//! assert_eq!((at(Reversed(Gamma), 0.1), at(Reversed(Levy), 0.1)), (1.0, 1.0));
//! near(at(GumbelMin, 0.3), 1.0 - at(GumbelMax, -0.3));
//! ```

mod bilogit;
mod cauchy;
mod cubic_hermite;
mod exp;
mod gamma;
mod gauss;
mod gudermannian;
mod gumbel;
mod half_line;
mod laplace;
mod levy;
mod logistic;
mod mlp;
mod reciprocal;
mod uniform;
mod unit_step;
mod wigner;

pub use half_line::{Forward, Reversed};

/// Passes the list of all families to the macro `$make`, after its arguments.
///
/// A line is a file of this folder: name of the variant of [`Family`](crate::Family), name in files and on the command line, softness. A
/// law and its mirror image `1 - s(-x)` share a file and a line; a single family on its line is its own mirror image. The order is that of
/// the documentation.
macro_rules! families {
    ($make:ident $($arguments:tt)*) => {
        $make! { [$($arguments)*]
            logistic: Logistic "logistic" => Logistic;
            bilogit: Bilogit "bilogit" => Bilogit;
            gauss: Gauss "gauss" => Gauss;
            laplace: Laplace "laplace" => Laplace;
            exp: Exp "exp" => Reversed(Exp), ExpForward "exp_forward" => Forward(Exp);
            gamma: Gamma "gamma" => Reversed(Gamma), GammaForward "gamma_forward" => Forward(Gamma);
            levy: Levy "levy" => Reversed(Levy), LevyForward "levy_forward" => Forward(Levy);
            uniform: Uniform "uniform" => Uniform;
            cubic_hermite: CubicHermite "cubic_hermite" => CubicHermite;
            wigner: Wigner "wigner" => Wigner;
            gudermannian: Gudermannian "gudermannian" => Gudermannian;
            cauchy: Cauchy "cauchy" => Cauchy;
            reciprocal: Reciprocal "reciprocal" => Reciprocal;
            gumbel: GumbelMax "gumbel_max" => GumbelMax, GumbelMin "gumbel_min" => GumbelMin;
            mlp: Mlp "mlp" => Mlp;
        }
    };
}
pub(crate) use families;

macro_rules! exports {
    ([] $($file:ident: $($variant:ident $name:literal => $softness:expr),+;)+) => {
        $(pub use $file::*;)+
    };
}
families!(exports);
