//! Scalar floats, and vectors of eight floats.
//!
//! All machines round each of these operations alike, and none is contracted, so explicit vectors (`x86`, `wasm`) and plain arrays
//! ([`Plain`]) give the same bits.
//!
//! Loops run over lane indices: the closure of an iterator is compiled without the target features of its caller, and is not vectorized.
#![allow(clippy::needless_range_loop, clippy::assign_op_pattern)]

pub(super) mod plain;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(super) mod wasm;
#[cfg(target_arch = "x86_64")]
pub(super) mod x86;

use std::{
    fmt::Debug,
    ops::{Add, AddAssign, Div, Mul, Neg, Sub},
    sync::atomic::{AtomicBool, Ordering},
};

pub(crate) use plain::Plain;

/// Numbers in a vector.
pub(crate) const LANES: usize = 8;
/// Neighbouring pixels of a row that are processed together: half a vector.
pub(crate) const GROUP: usize = LANES / 2;

/// An array of the values of an expression in each lane. Unrolled, since a compiler takes ten times as long over many small loops.
#[cfg(not(target_family = "wasm"))]
macro_rules! lanes {
    ($i:ident => $value:expr) => {
        lanes!(@ $i => $value, 0 1 2 3 4 5 6 7)
    };
    (@ $i:ident => $value:expr, $($lane:literal)*) => {
        [$({
            const $i: usize = $lane;
            $value
        }),*]
    };
}
/// An array of the values of an expression in each lane, as a loop: this keeps the module of a page small.
#[cfg(target_family = "wasm")]
macro_rules! lanes {
    ($i:ident => $value:expr) => {{
        #[allow(non_snake_case)]
        let lanes: [_; LANES] = std::array::from_fn(|$i| $value);
        lanes
    }};
}
pub(crate) use lanes;

/// `f32` or `f64`, with access to the bits that index the profile table.
///
/// ```
/// use softrast_kernel::Float;
///
/// fn mean<F: Float>(numbers: &[F]) -> F {
///     let sum = numbers.iter().fold(F::ZERO, |sum, &x| sum + x);
///     sum / F::from_f64(numbers.len() as f64)
/// }
/// assert_eq!((mean(&[1.0_f32, 2.0]), mean(&[1.0_f64, 2.0])), (1.5, 1.5));
/// ```
pub trait Float:
    Copy
    + Send
    + Sync
    + 'static
    + PartialOrd
    + Default
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Nearest float.
    fn from_f64(value: f64) -> Self;
    /// A whole number.
    fn of_whole(value: i32) -> Self;
    /// To double precision.
    fn to_f64(self) -> f64;
    /// The position of `self`, at least `2^-octaves`, among cells that start there, `2^bits` in each octave: the index of the cell, the
    /// position in the cell from 0 to 1, and the inverse of its width. For infinity and NaN the index is at least `octaves << bits`.
    fn cell(self, octaves: u32, bits: u32) -> (i32, Self, Self);
    /// Square root.
    fn sqrt(self) -> Self;
    /// Nearest integer, for numbers in [0, 2^22].
    fn nearest(self) -> i32;
    /// Nearest integer as a float, for numbers in [0, 2^22].
    fn rounded(self) -> Self;
    /// `e` to this power, to 2 units in the last place.
    fn exp(self) -> Self;
    /// `e^self` up to 88, in f32 with a relative error of at most 1.2e-7 (1 + |self|) and 0 below -87.34.
    fn power(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
}

/// Floats for which a machine may have vectors.
pub(crate) trait Vectors: Float {
    /// The best vectors of a machine that has them; see [`has_vectors`].
    type Best: Lanes<Float = Self>;
}

/// A vector of [`LANES`] floats.
pub(crate) trait Lanes:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + 'static
{
    /// One of the numbers.
    type Float: Float;
    /// Lane-wise condition.
    type Mask: Copy;
    /// Whole numbers.
    type Index: Copy;
    /// Selection of one of three numbers in each lane.
    type Which: Copy;
    /// Whether this needs AVX2.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    const NEEDS_AVX2: bool;
    /// Whether code generic over this type is also compiled for machines with AVX2.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    const GAINS_AVX2: bool;

    /// `value` in all lanes.
    fn splat(value: Self::Float) -> Self;
    /// The numbers of an array.
    fn of(values: &[Self::Float; LANES]) -> Self;
    /// The numbers as an array.
    fn array(self) -> [Self::Float; LANES];
    /// A vector of two groups of neighbours.
    fn of_groups(low: &[Self::Float; GROUP], high: &[Self::Float; GROUP]) -> Self;
    /// Adds the first half to one group of numbers, then the second half to another group or the same.
    fn add_to_groups(self, numbers: &mut [Self::Float], at: [u32; 2]);

    /// `1 / self`.
    fn recip(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// `e` to this power; see [`Float::exp`].
    #[inline(always)]
    fn exp(self) -> Self {
        let numbers = self.array();
        Self::of(&lanes!(I => Float::exp(numbers[I])))
    }
    /// See [`Float::power`].
    #[inline(always)]
    fn power(self) -> Self {
        let numbers = self.array();
        Self::of(&lanes!(I => Float::power(numbers[I])))
    }
    /// Natural logarithm.
    #[inline(always)]
    fn ln(self) -> Self {
        let numbers = self.array();
        Self::of(&lanes!(I => Float::ln(numbers[I])))
    }
    /// `-self`.
    fn neg(self) -> Self;
    /// `self` where it is less, else `other`.
    fn min(self, other: Self) -> Self;
    /// `self` where it is greater, else `other`.
    fn max(self, other: Self) -> Self;
    /// Where `self < other`.
    fn less(self, other: Self) -> Self::Mask;
    /// Where `self <= other`.
    fn at_most(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, else `no`.
    fn pick(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// `self` where the mask holds, else 0.
    fn only(self, mask: Self::Mask) -> Self;
    /// Selects the third number where the second mask holds, else the second where the first mask does, else the first.
    fn which(second: Self::Mask, third: Self::Mask) -> Self::Which;
    /// The lanes that select the first, the second and the third number.
    fn where_each(second: Self::Mask, third: Self::Mask) -> [Self::Mask; 3];
    /// One of the first three numbers for each lane.
    fn chosen(numbers: &[Self::Float; 4], which: Self::Which) -> Self;
    /// Writes three columns and zeros as rows, one per lane.
    fn to_rows(columns: [Self; 3], to: &mut [[Self::Float; 4]; LANES]);
    /// A mask as bits, the first lane lowest.
    fn bits(mask: Self::Mask) -> u32;
    /// The sum of all lanes, halves first.
    fn sum(self) -> Self::Float;
    /// The sums of six vectors, each as [`Lanes::sum`] adds it.
    #[inline(always)]
    fn sums([a, b, c, d, e, f]: [Self; 6]) -> [Self::Float; 6] {
        [a.sum(), b.sum(), c.sum(), d.sum(), e.sum(), f.sum()]
    }
    /// Nearest whole numbers, for numbers in [0, 2^22].
    fn nearest(self) -> Self::Index;
    /// Nearest whole numbers as floats, for numbers in [0, 2^22].
    fn rounded(self) -> Self;
    /// Packs the lanes where the mask holds, and returns their number. The rest of the arrays is overwritten.
    fn pack(keep: Self::Mask, numbers: [Self::Index; 2], to: [&mut [u32; LANES]; 2]) -> usize;
    /// Pixels of two groups relative to the origin of their face, given the first pixel of each: column, and row times 2^24.
    fn pixels(places: &[u32; 2]) -> (Self, Self);

    /// See [`Float::cell`].
    fn cell(self, octaves: u32, bits: u32) -> (Self::Index, Self, Self);
    /// `value` in all lanes.
    fn index(value: i32) -> Self::Index;
    /// The whole numbers of an array.
    fn indices(values: &[i32; LANES]) -> Self::Index;
    /// Whole numbers as an array.
    fn index_array(index: Self::Index) -> [i32; LANES];
    /// `a + b`.
    fn plus(a: Self::Index, b: Self::Index) -> Self::Index;
    /// `a - b`.
    fn minus(a: Self::Index, b: Self::Index) -> Self::Index;
    /// `yes` where the mask holds, else `no`.
    fn pick_index(mask: Self::Mask, yes: Self::Index, no: Self::Index) -> Self::Index;
    /// Rows of a table that has two sides with `cells` cells each, and a tail after each side. `second` selects the second side. Cells
    /// beyond the last become the tail.
    fn places(cell: Self::Index, cells: i32, second: Self::Mask) -> Places;
    /// Rows of a table of `count`, by their numbers.
    fn numbered(rows: &[u32; LANES], count: usize) -> Places;
    /// The rows of a table at some places, column by column.
    fn rows(table: &[[Self::Float; 4]], at: &Places) -> [Self; 4];
    /// Adds to the rows of a table at some places, lane by lane.
    fn add_to_rows(table: &mut [[Self::Float; 4]], at: &Places, columns: [Self; 4]);
    /// Two groups of rows, column by column.
    #[inline(always)]
    fn quads(rows: &[[Self::Float; 4]], [low, high]: [u32; 2]) -> [Self; 4] {
        let [low, high] = [low as usize, high as usize];
        let (low, high) = (&rows[low..low + GROUP], &rows[high..high + GROUP]);
        let row = lanes!(I => if I < GROUP { low[I % GROUP] } else { high[I % GROUP] });
        [
            Self::of(&lanes!(I => row[I][0])),
            Self::of(&lanes!(I => row[I][1])),
            Self::of(&lanes!(I => row[I][2])),
            Self::of(&lanes!(I => row[I][3])),
        ]
    }
    /// Adds to two groups of rows, the first one first.
    #[inline(always)]
    fn add_to_quads(rows: &mut [[Self::Float; 4]], at: [u32; 2], [a, b, c, d]: [Self; 4]) {
        let (a, b, c, d) = (a.array(), b.array(), c.array(), d.array());
        for half in 0..2 {
            let first = at[half] as usize;
            let own = &mut rows[first..first + GROUP];
            for i in 0..GROUP {
                let k = half * GROUP + i;
                let row = own[i];
                own[i] = [row[0] + a[k], row[1] + b[k], row[2] + c[k], row[3] + d[k]];
            }
        }
    }
}

/// A computation with vectors, which is also compiled for machines with better ones.
pub(crate) trait Work {
    /// The result.
    type Output;
    /// Runs the computation. Must be inlined, like everything it calls.
    fn run(self) -> Self::Output;
}

/// Runs some work with vectors `L`, compiled for AVX2 if `L` gains from it and this machine has it. Products and sums are never contracted,
/// so the bits are the same.
pub(crate) fn run<L: Lanes, W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<W: Work>(work: W) -> W::Output {
            work.run()
        }
        if L::NEEDS_AVX2 {
            // SAFETY: vectors that need AVX2 exist only after the feature was detected.
            #[allow(unsafe_code)]
            return unsafe { avx2(work) };
        }
        if L::GAINS_AVX2 && has_vectors() {
            // SAFETY: the feature was just detected.
            #[allow(unsafe_code)]
            return unsafe { avx2(work) };
        }
    }
    work.run()
}

static PORTABLE: AtomicBool = AtomicBool::new(false);

/// Sets whether passes use the machine's vectors instead of arrays, for the whole process; they do by default. The bits are the same, which
/// tests check.
pub fn use_vectors(yes: bool) {
    PORTABLE.store(!yes, Ordering::Relaxed);
}

/// Whether this machine has better vectors than arrays: AVX2, detected at run time, or those of WebAssembly, fixed at compile time for the
/// whole program.
pub(crate) fn has_vectors() -> bool {
    #[cfg(target_arch = "x86_64")]
    let has_them = is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    let has_them = cfg!(all(target_arch = "wasm32", target_feature = "simd128"));
    has_them && !PORTABLE.load(Ordering::Relaxed)
}

/// Rows of a table, one for each lane.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    /// Row numbers, each below `rows`; byte offsets from the first row for explicit vectors such as those of `x86`.
    at: [u32; LANES],
    /// Lower bound of the number of rows of the table.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    rows: usize,
}

impl Places {
    /// Numbers of the rows, in plain arrays.
    #[cfg(test)]
    pub(crate) fn numbers<L: Lanes>(&self) -> [usize; LANES] {
        assert!(!L::NEEDS_AVX2, "vectors have places of their own");
        self.at.map(|at| at as usize)
    }

    /// The first row of a table with one row or more.
    pub(crate) const FIRST: Self = Self { at: [0; LANES], rows: 1 };
}
