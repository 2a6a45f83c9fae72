//! The families of soft steps, one per file. [`Family`](crate::Family) selects one by name.

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
