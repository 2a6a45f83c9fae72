use softrast_tensor::{Backend, DType, Tensor, TensorData};

use crate::Softness;

/// The smallest and the largest distance sampled, in the unit of x.
const NEAREST: f64 = 1e-12;
const FARTHEST: f64 = 1e6;

/// Distance used for infinity: its square fits an f32, and every family is at its limit.
const LIMIT: f64 = 1e18;

/// Distances sampled on each side, 4 % apart.
const COARSE: usize = 1024;

/// Distances by which each refinement divides an interval; four of them reach 2e-10 relative.
const FINE: usize = 128;
const REFINEMENTS: usize = 4;

/// The interval between `-outer` and `inner`, outside of which an optical depth is at its limits.
///
/// ```
/// use softrast_softness::{Family, Softness, Support, support};
/// use softrast_tensor::NdArray;
///
/// let phi = Family::Uniform.default_phi(0.1);
/// let Support { outer, inner, left, .. } =
///     support::<NdArray>(&Family::Uniform, &phi, 1e-6, &Default::default());
/// assert!((outer - 0.1).abs() < 1e-6 && (inner - 0.1).abs() < 1e-6 && left == 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Beyond this distance outside, the optical depth differs from `left` by at most the excess. Infinite if that is not reached within
    /// 1e6.
    pub outer: f64,
    /// Beyond this distance inside, the transmitted light, `exp(-q)`, is at most the excess, or `q` is at its limit to within the excess.
    /// Infinite if neither is reached within 1e6.
    pub inner: f64,
    /// The limit of the optical depth far outside; not 0 for some MLPs.
    pub left: f64,
    /// The optical depth at `inner`, or its limit far inside if that is infinite.
    pub right: f64,
}

/// The distances between which the optical depth of `softness` changes by more than `excess`.
///
/// It is evaluated in f64 if the backend supports that, whatever the backend's float type, at 1024 distances per side in [1e-12, 1e6] (unit
/// of x), and the last distance that is not settled is then refined to 2e-10 relative; the settled end of the interval is returned. The
/// depth need not be monotone, but a bump narrower than 4 % of its distance can be missed. A settled side gives 0.
///
/// With at most F faces culled at a pixel, an excess of `E / F` changes its coverage by at most E.
///
/// # Panics
///
/// If `phi` has the wrong length, or `excess` is not positive.
pub fn support<B: Backend>(
    softness: &impl Softness,
    phi: &[f64],
    excess: f64,
    device: &B::Device,
) -> Support {
    assert_eq!(phi.len(), softness.parameters(), "wrong number of parameters for {softness:?}");
    assert!(excess > 0.0, "excess {excess} is not positive");
    let depth = Depth::<B>::new(phi, device);
    let at = |x: &[f64]| depth.at(softness, x);
    let limits = at(&[-LIMIT, LIMIT]);
    let (left, right) = (limits[0], limits[1]);
    let outside = |r: &[f64]| at(&r.iter().map(|r| -r).collect::<Vec<_>>());
    let outer = settled_beyond(outside, |q| (q - left).abs() <= excess);
    let inner = settled_beyond(at, |q| (-q).exp() <= excess || (q - right).abs() <= excess);
    let right = if inner.is_finite() { at(&[inner])[0] } else { right };
    Support { outer, inner, left, right }
}

/// The distance beyond which every value of `curve` is `settled`: 0 if all are, infinite if that is not reached within 1e6.
///
/// `curve` returns the values at distances in [1e-12, 1e6]; it is sampled at 1024 of them, and the last one that is not settled is then
/// refined to 2e-10 relative; the settled end of the interval is returned. A bump narrower than 4 % of its distance can be missed.
///
/// ```
/// use softrast_softness::settled_beyond;
///
/// let halved = settled_beyond(|x| x.iter().map(|x| (-x).exp()).collect(), |y| y < 0.5);
/// assert!((halved - 2_f64.ln()).abs() < 1e-9);
/// ```
pub fn settled_beyond(curve: impl Fn(&[f64]) -> Vec<f64>, settled: impl Fn(f64) -> bool) -> f64 {
    let mut found = Interval { start: NEAREST, end: FARTHEST };
    for count in std::iter::once(COARSE).chain([FINE; REFINEMENTS]) {
        let grid = found.grid(count);
        match curve(&grid).iter().rposition(|&value| !settled(value)) {
            None => return 0.0,
            Some(last) if last + 1 == count => return f64::INFINITY,
            Some(last) => found = Interval { start: grid[last], end: grid[last + 1] },
        }
    }
    found.end
}

/// Evaluates an optical depth for numbers.
struct Depth<'a, B: Backend> {
    phi: Tensor<B, 1>,
    dtype: DType,
    device: &'a B::Device,
}

impl<'a, B: Backend> Depth<'a, B> {
    fn new(phi: &[f64], device: &'a B::Device) -> Self {
        let dtype = if B::supports_dtype(device, DType::F64) { DType::F64 } else { DType::F32 };
        let data = TensorData::new(phi.to_vec(), [phi.len()]);
        Self { phi: Tensor::from_data(data, (device, dtype)), dtype, device }
    }

    fn at(&self, softness: &impl Softness, x: &[f64]) -> Vec<f64> {
        let data = TensorData::new(x.to_vec(), [x.len()]);
        let x = Tensor::<B, 1>::from_data(data, (self.device, self.dtype));
        softness.optical_depth(self.phi.clone(), x).into_data().iter().collect()
    }
}

/// Two distances between which the last unsettled one lies.
#[derive(Clone, Copy)]
struct Interval {
    start: f64,
    end: f64,
}

impl Interval {
    /// `count` distances in constant ratio, including both ends.
    fn grid(self, count: usize) -> Vec<f64> {
        let ratio = (self.end / self.start).ln() / (count - 1) as f64;
        let mut grid: Vec<_> = (0..count).map(|k| self.start * (ratio * k as f64).exp()).collect();
        grid[count - 1] = self.end;
        grid
    }
}
