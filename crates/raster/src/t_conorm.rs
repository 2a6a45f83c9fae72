use std::{fmt, str::FromStr};

use softrast_softness::Softness;
use softrast_tensor::{Backend, DType, Tensor};

/// Optical depth at which `exp(q)` is clamped: a face that transmits less than e^-40 = 4e-18 of the light counts as transmitting that.
const DEEPEST: f64 = 40.0;
/// Powers of `exp(q)` are clamped to `exp` of this, so that sums of them, and their slopes, fit a float. In f32 a face then covers at most
/// `1 - exp(-64 / p)` with Dombi and Schweizer-Sklar of parameter p: all but 1e-7 up to p = 4.
const LARGEST: [f64; 2] = [64.0, 600.0];
/// Smallest number that enters a power or a logarithm.
const SMALLEST: f64 = 1e-30;
/// Sums below this, in f32 and f64, count as 0: the second derivative of a root fits an f64 there, the first an f32.
const LEAST_SUM: [f64; 2] = [1e-30, 1e-150];

/// Aggregation of the coverages of several faces: an Archimedean T-conorm `A = g⁻¹(Σ g(s))`.
///
/// Each has an additive generator g, so that a silhouette is a sum over faces for every T-conorm. `max` is the only common one without a
/// generator, and is not supported.
///
/// Source: Petersen et al. 2022 for the T-conorms; docs/notes.md, T-conorms, for the generators.
///
/// ```
/// use std::f64::consts::LN_2;
///
/// use softrast_raster::{TConorm, UnknownTConorm};
///
/// // Two faces cover half of a pixel each: an optical depth of ln 2.
/// for (name, both) in [("probabilistic", 0.75), ("einstein", 0.8), ("yager:1", 1.0)] {
///     let t_conorm: TConorm = name.parse()?;
///     assert!((t_conorm.coverage_of(2.0 * t_conorm.generator(LN_2)) - both).abs() < 1e-12);
/// }
/// let unknown: UnknownTConorm = "max".parse::<TConorm>().unwrap_err();
/// assert!(unknown.to_string().starts_with("unknown T-conorm \"max\""));
/// # Ok::<(), UnknownTConorm>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum TConorm {
    /// `a + b - ab`, the default.
    #[default]
    Probabilistic,
    /// `(a + b) / (1 + ab)`.
    Einstein,
    /// Hamacher with p > 0; p = 0 is [`TConorm::Dombi`] with 1.
    Hamacher(f64),
    /// Frank with p > 0, p not 1.
    Frank(f64),
    /// `min(1, (a^p + b^p)^(1/p))`, p > 0.
    Yager(f64),
    /// `1 - exp(-((-ln(1-a))^p + (-ln(1-b))^p)^(1/p))`, p > 0.
    AczelAlsina(f64),
    /// `1 - 1 / (1 + ((a/(1-a))^p + (b/(1-b))^p)^(1/p))`, p > 0.
    Dombi(f64),
    /// `1 - ((1-a)^p + (1-b)^p - 1)^(1/p)`, p < 0.
    SchweizerSklar(f64),
}

/// A T-conorm that does not exist, or whose parameter is out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown T-conorm {found:?}: use probabilistic, einstein, hamacher:p (p > 0), frank:p \
     (p > 0, p != 1), yager:p, aczel_alsina:p, dombi:p (p > 0) or schweizer_sklar:p (p < 0)"
)]
pub struct UnknownTConorm {
    found: String,
}

impl FromStr for TConorm {
    type Err = UnknownTConorm;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let unknown = || UnknownTConorm { found: text.to_owned() };
        let (name, p) = match text.split_once(':') {
            Some((name, p)) => (name, Some(p.parse::<f64>().map_err(|_| unknown())?)),
            None => (text, None),
        };
        let conorm = match (name, p) {
            ("probabilistic", None) => Self::Probabilistic,
            ("einstein", None) => Self::Einstein,
            ("hamacher", Some(p)) => Self::Hamacher(p),
            ("frank", Some(p)) => Self::Frank(p),
            ("yager", Some(p)) => Self::Yager(p),
            ("aczel_alsina", Some(p)) => Self::AczelAlsina(p),
            ("dombi", Some(p)) => Self::Dombi(p),
            ("schweizer_sklar", Some(p)) => Self::SchweizerSklar(p),
            _ => return Err(unknown()),
        };
        if conorm.is_valid() { Ok(conorm) } else { Err(unknown()) }
    }
}

impl fmt::Display for TConorm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Probabilistic => write!(f, "probabilistic"),
            Self::Einstein => write!(f, "einstein"),
            Self::Hamacher(p) => write!(f, "hamacher:{p}"),
            Self::Frank(p) => write!(f, "frank:{p}"),
            Self::Yager(p) => write!(f, "yager:{p}"),
            Self::AczelAlsina(p) => write!(f, "aczel_alsina:{p}"),
            Self::Dombi(p) => write!(f, "dombi:{p}"),
            Self::SchweizerSklar(p) => write!(f, "schweizer_sklar:{p}"),
        }
    }
}

impl TConorm {
    fn is_valid(self) -> bool {
        match self {
            Self::Probabilistic | Self::Einstein => true,
            Self::Frank(p) => p > 0.0 && p != 1.0 && p.is_finite(),
            Self::SchweizerSklar(p) => p < 0.0 && p.is_finite(),
            Self::Hamacher(p) | Self::Yager(p) | Self::AczelAlsina(p) | Self::Dombi(p) => {
                p > 0.0 && p.is_finite()
            }
        }
    }

    /// Whether `g(s)` is the optical depth of s or close to it: then it increases as slowly as that near 1, and near 0 it is at least a
    /// tenth of s. Others may be powers of s, whose magnitudes floats can represent and a fixed unit cannot.
    #[cfg(feature = "gpu")]
    pub(crate) fn is_like_depths(self) -> bool {
        match self {
            Self::Probabilistic | Self::Einstein => true,
            Self::Hamacher(p) | Self::Frank(p) => p >= 0.1,
            Self::Yager(_) | Self::AczelAlsina(_) | Self::Dombi(_) | Self::SchweizerSklar(_) => {
                false
            }
        }
    }

    /// `g(s(x))` and its derivative with respect to x, both shaped like `x`.
    ///
    /// Computed from the optical depth and the hazard of the softness, which keep their digits where 1 - s does not.
    pub fn profile<B: Backend, S: Softness, const D: usize>(
        self,
        softness: &S,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> (Tensor<B, D>, Tensor<B, D>) {
        let sums = x.dtype();
        self.profile_for(sums, softness, phi, x)
    }

    /// [`TConorm::profile`] in the float type of `x`, small enough for sums in the float type `sums`.
    pub(crate) fn profile_for<B: Backend, S: Softness, const D: usize>(
        self,
        sums: DType,
        softness: &S,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> (Tensor<B, D>, Tensor<B, D>) {
        let q = || softness.optical_depth(phi.clone(), x.clone());
        let s = || softness.value(phi.clone(), x.clone());
        let density = || softness.density(phi.clone(), x.clone());
        let hazard = || softness.hazard(phi.clone(), x.clone());
        match self {
            Self::Probabilistic => softness.depth_and_hazard(phi, x).into(),
            Self::Einstein => {
                let s = s();
                let slope = (hazard() + density() / (s.clone() + 1.0)) * 0.5;
                ((q() + s.log1p()) * 0.5, slope)
            }
            Self::Hamacher(p) => {
                let s = s();
                let rest = s.clone() * (p - 1.0) + 1.0;
                let slope = hazard() + density() * (p - 1.0) / rest;
                (q() + (s * (p - 1.0)).log1p(), slope)
            }
            Self::Frank(p) => {
                // With t = 1 - s and w(t) = (p^t - 1) / t: g = q - ln(w / (p - 1)).
                let q = q();
                let t = q.clone().clamp_max(DEEPEST).neg().exp();
                let power = expm1(t.clone() * p.ln());
                let value = q - (power.clone() / t.clone() / (p - 1.0)).log();
                let slope = hazard() * (t * p.ln() * (power.clone() + 1.0) / power);
                (value, slope)
            }
            Self::Yager(p) => {
                let s = s().clamp_min(SMALLEST);
                let slope = power(s.clone(), p - 1.0) * density() * p;
                (power(s, p), slope)
            }
            Self::AczelAlsina(p) => {
                let q = q().clamp_min(SMALLEST);
                let slope = power(q.clone(), p - 1.0) * hazard() * p;
                (power(q, p), slope)
            }
            Self::Dombi(p) => {
                // d ln(e^q - 1) / dq = 1 / s.
                let q = q();
                let deepest = deepest(p, sums);
                let hazard = hazard().mask_fill(q.clone().greater_elem(deepest), 0.0);
                let odds = expm1(q.clamp_max(deepest)).clamp_min(SMALLEST);
                let value = power(odds, p);
                let slope = value.clone() * hazard * p / s().clamp_min(SMALLEST);
                (value, slope)
            }
            Self::SchweizerSklar(p) => {
                let q = q();
                let deepest = deepest(-p, sums);
                let hazard = hazard().mask_fill(q.clone().greater_elem(deepest), 0.0);
                let power = expm1(q.clamp_max(deepest) * -p);
                (power.clone(), (power + 1.0) * hazard * -p)
            }
        }
    }

    /// Coverage `A = g⁻¹(S)` in [0, 1] of the sum `S >= 0`, same shape.
    pub fn coverage<B: Backend, const D: usize>(self, sum: Tensor<B, D>) -> Tensor<B, D> {
        let root = |sum: Tensor<B, D>, p: f64| {
            let nothing = sum.clone().lower_elem(for_type(LEAST_SUM, sum.dtype()));
            power(sum.mask_fill(nothing.clone(), 1.0), 1.0 / p).mask_fill(nothing, 0.0)
        };
        match self {
            Self::Probabilistic => covered(sum),
            Self::Einstein => sum.tanh(),
            Self::Hamacher(p) => {
                let covered = covered(sum);
                // 1 - (1 - p) e^-S, in terms of the coverage.
                covered.clone() / (covered * (1.0 - p) + p)
            }
            Self::Frank(p) => {
                let inner = sum.neg().exp() * (p - 1.0);
                (inner.log1p() / p.ln()).neg() + 1.0
            }
            Self::Yager(p) => root(sum, p).clamp_max(1.0),
            Self::AczelAlsina(p) => covered(root(sum, p)),
            Self::Dombi(p) => {
                let odds = root(sum, p);
                odds.clone() / (odds + 1.0)
            }
            Self::SchweizerSklar(p) => power(sum + 1.0, 1.0 / p).neg() + 1.0,
        }
    }

    /// Largest `e` such that adding up to `e` to a sum never moves the coverage by more than
    /// `tolerance`.
    ///
    /// Where g is convex, `A(S)` is concave and moves most at S = 0: `e = g(tolerance)`. Elsewhere
    /// (p < 1, Hamacher with p > 2) it is `tolerance` over the steepest slope of A.
    pub fn slack(self, tolerance: f64) -> f64 {
        let steepest = |slope: f64| tolerance / slope;
        match self {
            Self::Hamacher(p) if p > 2.0 => steepest(p / (4.0 * (p - 1.0)).min(p)),
            Self::Yager(p) if p < 1.0 => steepest(1.0 / p),
            Self::AczelAlsina(p) if p < 1.0 => {
                let (a, at) = (1.0 / p, 1.0 - p);
                steepest(a * at.powf(1.0 - p) * (-at).exp())
            }
            Self::Dombi(p) if p < 1.0 => {
                let a = 1.0 / p;
                let at: f64 = (a - 1.0) / (a + 1.0);
                steepest(a * at.powf(1.0 - p) / (1.0 + at).powi(2))
            }
            _ => self.generator(-(-tolerance).ln_1p()),
        }
    }

    /// The largest `S dA/dS`: the largest change of the coverage per relative error of the sum.
    pub(crate) fn sensitivity(self) -> f64 {
        let moved = |k: i32| {
            let sum = f64::exp2(0.25 * f64::from(k));
            (self.coverage_of(1.001 * sum) - self.coverage_of(sum)) / 0.001
        };
        (-120..80).map(moved).fold(0.0, f64::max)
    }

    /// [`TConorm::coverage`] for a number.
    pub fn coverage_of(self, sum: f64) -> f64 {
        match self {
            Self::Probabilistic => -(-sum).exp_m1(),
            Self::Einstein => sum.tanh(),
            Self::Hamacher(p) => {
                let covered = -(-sum).exp_m1();
                covered / (covered * (1.0 - p) + p)
            }
            Self::Frank(p) => 1.0 - ((-sum).exp() * (p - 1.0)).ln_1p() / p.ln(),
            Self::Yager(p) => sum.powf(1.0 / p).min(1.0),
            Self::AczelAlsina(p) => -(-sum.powf(1.0 / p)).exp_m1(),
            Self::Dombi(p) => {
                let odds = sum.powf(1.0 / p);
                odds / (odds + 1.0)
            }
            Self::SchweizerSklar(p) => 1.0 - (sum + 1.0).powf(1.0 / p),
        }
    }

    /// `g` as a function of the optical depth, for a number.
    pub fn generator(self, q: f64) -> f64 {
        let s = -(-q).exp_m1();
        match self {
            Self::Probabilistic => q,
            Self::Einstein => 0.5 * (q + s.ln_1p()),
            Self::Hamacher(p) => q + ((p - 1.0) * s).ln_1p(),
            Self::Frank(p) => {
                let t = (-q.min(DEEPEST)).exp();
                q - ((t * p.ln()).exp_m1() / t / (p - 1.0)).ln()
            }
            Self::Yager(p) => s.powf(p),
            Self::AczelAlsina(p) => q.powf(p),
            Self::Dombi(p) => q.min(deepest(p, DType::F64)).exp_m1().powf(p),
            Self::SchweizerSklar(p) => (q.min(deepest(-p, DType::F64)) * -p).exp_m1(),
        }
    }

    /// The largest loss of coverage at a pixel due to the range of its sum in this float type: of a face with the optical depth `q`,
    /// clamped at the largest power, and of a sum that counts as 0.
    pub(crate) fn lost_to_range(self, sums: DType, q: f64) -> f64 {
        let held = |p: f64| (-q.min(deepest(p, sums))).exp() - (-q.min(DEEPEST)).exp();
        let least = |p: f64| for_type(LEAST_SUM, sums).powf(1.0 / p);
        match self {
            Self::Dombi(p) => held(p).max(least(p)),
            Self::SchweizerSklar(p) => held(-p),
            Self::Yager(p) | Self::AczelAlsina(p) => least(p),
            _ => 0.0,
        }
    }
}

/// `1 - exp(-sum)`. Not computed by [`expm1`]: its gradient would lose the digits of `exp(-sum)`, which drive the pixels that are nearly
/// covered.
fn covered<B: Backend, const D: usize>(sum: Tensor<B, D>) -> Tensor<B, D> {
    sum.neg().exp().neg() + 1.0
}

/// The optical depth above which `exp(p q)` counts as constant.
fn deepest(p: f64, dtype: DType) -> f64 {
    DEEPEST.min(for_type(LARGEST, dtype) / p)
}

/// The constant for this float type, of f32 and f64.
fn for_type([single, double]: [f64; 2], dtype: DType) -> f64 {
    if dtype == DType::F64 { double } else { single }
}

/// `x^p` of positive numbers.
///
/// burn 0.21 rounds exponents to f32, whatever the float type.
#[allow(clippy::disallowed_methods, reason = "the one place that knows of it")]
fn power<B: Backend, const D: usize>(x: Tensor<B, D>, p: f64) -> Tensor<B, D> {
    if x.dtype() == DType::F64 { (x.log() * p).exp() } else { x.powf_scalar(p) }
}

/// `exp(x) - 1` without cancellation: `tanh(x/2) (exp(x) + 1)`.
fn expm1<B: Backend, const D: usize>(x: Tensor<B, D>) -> Tensor<B, D> {
    (x.clone() * 0.5).tanh() * (x.exp() + 1.0)
}
