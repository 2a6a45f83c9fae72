//! Eight numbers that are computed together.
//!
//! Every operation is one that all machines round alike, and none is contracted. So explicit vectors (`x86`, `wasm`) and plain arrays
//! ([`Plain`]) give the same bits.
//!
//! Loops run over numbers of lanes: an iterator's closure is a function without the features of its caller, and is not turned
//! into vectors.
#![allow(clippy::needless_range_loop, clippy::assign_op_pattern)]

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::ops::{Add, AddAssign, Mul, Sub};

use super::float::Float;

/// The best vectors of `f32`, for machines that [have them](has_vectors).
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(crate) type F32x8 = wasm::F32x8;
/// The best vectors of `f32`, for machines that [have them](has_vectors).
#[cfg(target_arch = "x86_64")]
pub(crate) type F32x8 = x86::F32x8;
/// The best vectors of `f32`, for machines that [have them](has_vectors).
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128"))))]
pub(crate) type F32x8 = Plain<f32>;

/// Numbers in a vector.
pub(crate) const LANES: usize = 8;
/// Neighbours of a row that always come together: half a vector.
pub(crate) const GROUP: usize = LANES / 2;

/// An array of what an expression says of each lane. Written out, since a compiler takes ten times as long over so many little loops.
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
/// The same, in the fewest bytes: a page has to be loaded.
#[cfg(target_family = "wasm")]
macro_rules! lanes {
    ($i:ident => $value:expr) => {{
        #[allow(non_snake_case)]
        let lanes: [_; LANES] = std::array::from_fn(|$i| $value);
        lanes
    }};
}
pub(crate) use lanes;

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
    /// Whether something holds, lane by lane.
    type Mask: Copy;
    /// Whole numbers.
    type Index: Copy;
    /// Which of three numbers each lane takes.
    type Which: Copy;
    /// Whether this needs AVX2.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    const NEEDS_AVX2: bool;
    /// Whether what uses this is compiled for machines with AVX2 as well.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    const GAINS_AVX2: bool;

    /// The same number in all lanes.
    fn splat(value: Self::Float) -> Self;
    /// The numbers of an array.
    fn of(values: &[Self::Float; LANES]) -> Self;
    /// The numbers as an array.
    fn array(self) -> [Self::Float; LANES];
    /// Two groups of neighbours.
    fn of_groups(low: &[Self::Float; GROUP], high: &[Self::Float; GROUP]) -> Self;
    /// Adds the first half to one group of numbers, then the second to another or the same.
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
    /// The third where the second mask holds, else the second where the first does, else the first.
    fn which(second: Self::Mask, third: Self::Mask) -> Self::Which;
    /// Where that is the first, the second and the third.
    fn where_each(second: Self::Mask, third: Self::Mask) -> [Self::Mask; 3];
    /// One of the first three numbers for each lane.
    fn chosen(numbers: &[Self::Float; 4], which: Self::Which) -> Self;
    /// Writes three columns and zeros as rows, one for each lane.
    fn to_rows(columns: [Self; 3], to: &mut [[Self::Float; 4]; LANES]);
    /// A mask as bits, the first lane lowest.
    fn bits(mask: Self::Mask) -> u32;
    /// The sum of all lanes, halves first.
    fn sum(self) -> Self::Float;
    /// Nearest whole numbers, for numbers in [0, 2^22].
    fn nearest(self) -> Self::Index;
    /// Nearest whole numbers as floats, for numbers in [0, 2^22].
    fn rounded(self) -> Self;
    /// Writes the lanes where the mask holds one behind the other, and says how many there are. What stands behind them is overwritten.
    fn pack(keep: Self::Mask, numbers: [Self::Index; 2], to: [&mut [u32; LANES]; 2]) -> usize;
    /// Places of the pixels of two groups from the origin of their face, from those of the first pixels: column, and row times 2^24.
    fn pixels(places: &[u32; 2]) -> (Self, Self);

    /// See [`Float::cell`].
    fn cell(self, octaves: u32, bits: u32) -> (Self::Index, Self, Self);
    /// The same whole number in all lanes.
    fn index(value: i32) -> Self::Index;
    /// The whole numbers of an array.
    fn indices(values: &[i32; LANES]) -> Self::Index;
    /// Whole numbers as an array.
    fn index_array(index: Self::Index) -> [i32; LANES];
    /// Sums and differences of whole numbers.
    fn plus(a: Self::Index, b: Self::Index) -> Self::Index;
    /// `a - b`.
    fn minus(a: Self::Index, b: Self::Index) -> Self::Index;
    /// `yes` where the mask holds, else `no`.
    fn pick_index(mask: Self::Mask, yes: Self::Index, no: Self::Index) -> Self::Index;
    /// Places in a table of two sides with so many cells each, and a tail behind the last of each; where the mask holds on its second
    /// side. Cells beyond the last are the tail.
    fn places(cell: Self::Index, cells: i32, second: Self::Mask) -> Places;
    /// Rows of a table of `count`, by their numbers.
    fn numbered(rows: &[u32; LANES], count: usize) -> Places;
    /// The rows of a table at some places, column by column.
    fn rows(table: &[[Self::Float; 4]], at: &Places) -> [Self; 4];
    /// Adds to the rows of a table at some places, lane by lane.
    fn add_to_rows(table: &mut [[Self::Float; 4]], at: &Places, columns: [Self; 4]);
}

/// Something that is computed with vectors, and compiled for the machines that have better ones.
pub(crate) trait Work {
    /// What comes of it.
    type Output;
    /// Does it. To be inlined, like all that it calls.
    fn run(self) -> Self::Output;
}

/// Does some work with vectors `L`, compiled for AVX2 where they gain from it and this machine has it. Products and sums are
/// never contracted, so that the bits are the same.
pub(crate) fn run<L: Lanes, W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<W: Work>(work: W) -> W::Output {
            work.run()
        }
        if L::NEEDS_AVX2 {
            // SAFETY: the feature was detected before there were such vectors.
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

/// Lets tests walk as on a machine without AVX2.
#[cfg(test)]
pub(crate) static PORTABLE: std::sync::atomic::AtomicBool =
    std::sync::atomic::AtomicBool::new(false);

/// Whether this machine has vectors that are better than arrays: AVX2, which is asked for at run time, or those of WebAssembly, for which
/// all of a program is compiled or nothing.
pub(crate) fn has_vectors() -> bool {
    #[cfg(test)]
    if PORTABLE.load(std::sync::atomic::Ordering::SeqCst) {
        return false;
    }
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    cfg!(all(target_arch = "wasm32", target_feature = "simd128"))
}

/// Rows of a table, one for each lane.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    /// Each below `rows`; of vectors as explicit as in `x86`, bytes from the first row.
    at: [u32; LANES],
    /// What the table has at least.
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

/// A vector as an array: what every machine has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain<F>([F; LANES]);

macro_rules! operator {
    ($trait:ident, $function:ident, $operator:tt) => {
        impl<F: Float> $trait for Plain<F> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(lanes!(I => self.0[I] $operator other.0[I]))
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);

impl<F: Float> AddAssign for Plain<F> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<F: Float> Lanes for Plain<F> {
    type Float = F;
    type Mask = [bool; LANES];
    type Index = [i32; LANES];
    type Which = [[bool; LANES]; 2];
    const NEEDS_AVX2: bool = false;
    // Floats of 32 bits have vectors of their own there.
    const GAINS_AVX2: bool = size_of::<F>() == 8;

    #[inline(always)]
    fn splat(value: F) -> Self {
        Self(lanes!(_I => value))
    }

    #[inline(always)]
    fn of(values: &[F; LANES]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn array(self) -> [F; LANES] {
        self.0
    }

    #[inline(always)]
    fn of_groups(low: &[F; GROUP], high: &[F; GROUP]) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (*low, *high);
        Self([a, b, c, d, e, f, g, h])
    }

    #[inline(always)]
    fn add_to_groups(self, numbers: &mut [F], at: [u32; 2]) {
        let [a, b, c, d, e, f, g, h] = self.0;
        let low = &mut numbers[at[0] as usize..at[0] as usize + GROUP];
        (low[0], low[1], low[2], low[3]) = (low[0] + a, low[1] + b, low[2] + c, low[3] + d);
        let high = &mut numbers[at[1] as usize..at[1] as usize + GROUP];
        (high[0], high[1], high[2], high[3]) = (high[0] + e, high[1] + f, high[2] + g, high[3] + h);
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self(lanes!(I => F::ONE / self.0[I]))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(lanes!(I => self.0[I].sqrt()))
    }

    #[inline(always)]
    fn neg(self) -> Self {
        Self(lanes!(I => -self.0[I]))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(lanes!(I => if self.0[I] < other.0[I] { self.0[I] } else { other.0[I] }))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(lanes!(I => if self.0[I] > other.0[I] { self.0[I] } else { other.0[I] }))
    }

    #[inline(always)]
    fn less(self, other: Self) -> [bool; LANES] {
        lanes!(I => self.0[I] < other.0[I])
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> [bool; LANES] {
        lanes!(I => self.0[I] <= other.0[I])
    }

    #[inline(always)]
    fn pick(mask: [bool; LANES], yes: Self, no: Self) -> Self {
        Self(lanes!(I => if mask[I] { yes.0[I] } else { no.0[I] }))
    }

    #[inline(always)]
    fn only(self, mask: [bool; LANES]) -> Self {
        Self::pick(mask, self, Self::splat(F::ZERO))
    }

    #[inline(always)]
    fn which(second: [bool; LANES], third: [bool; LANES]) -> [[bool; LANES]; 2] {
        [second, third]
    }

    #[inline(always)]
    fn where_each(second: [bool; LANES], third: [bool; LANES]) -> [[bool; LANES]; 3] {
        [lanes!(I => !second[I] & !third[I]), lanes!(I => second[I] & !third[I]), third]
    }

    #[inline(always)]
    fn chosen(&[a, b, c, _]: &[F; 4], [second, third]: [[bool; LANES]; 2]) -> Self {
        Self::pick(third, Self::splat(c), Self::pick(second, Self::splat(b), Self::splat(a)))
    }

    #[inline(always)]
    fn to_rows([a, b, c]: [Self; 3], to: &mut [[F; 4]; LANES]) {
        *to = lanes!(I => [a.0[I], b.0[I], c.0[I], F::ZERO]);
    }

    #[inline(always)]
    fn bits(mask: [bool; LANES]) -> u32 {
        let [a, b, c, d, e, f, g, h] = lanes!(I => u32::from(mask[I]) << I);
        a | b | c | d | e | f | g | h
    }

    #[inline(always)]
    fn sum(self) -> F {
        let [a, b, c, d, e, f, g, h] = self.0;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }

    #[inline(always)]
    fn nearest(self) -> [i32; LANES] {
        lanes!(I => self.0[I].nearest())
    }

    #[inline(always)]
    fn rounded(self) -> Self {
        Self(lanes!(I => self.0[I].rounded()))
    }

    #[inline(always)]
    fn pack(
        keep: [bool; LANES],
        [a, b]: [[i32; LANES]; 2],
        [to_a, to_b]: [&mut [u32; LANES]; 2],
    ) -> usize {
        let mut count = 0;
        lanes!(I => {
            let free = count % LANES;
            (to_a[free], to_b[free]) = (a[I] as u32, b[I] as u32);
            count += usize::from(keep[I]);
        });
        count
    }

    #[inline(always)]
    fn pixels(places: &[u32; 2]) -> (Self, Self) {
        let x =
            lanes!(I => F::of_whole((places[I / GROUP] & 0x00ff_ffff) as i32 + (I % GROUP) as i32));
        let y = lanes!(I => F::of_whole((places[I / GROUP] >> 24) as i32));
        (Self(x), Self(y))
    }

    #[inline(always)]
    fn cell(self, octaves: u32, bits: u32) -> ([i32; LANES], Self, Self) {
        let cells = lanes!(I => self.0[I].cell(octaves, bits));
        (lanes!(I => cells[I].0), Self(lanes!(I => cells[I].1)), Self(lanes!(I => cells[I].2)))
    }

    #[inline(always)]
    fn index(value: i32) -> [i32; LANES] {
        lanes!(_I => value)
    }

    #[inline(always)]
    fn indices(values: &[i32; LANES]) -> [i32; LANES] {
        *values
    }

    #[inline(always)]
    fn index_array(index: [i32; LANES]) -> [i32; LANES] {
        index
    }

    #[inline(always)]
    fn plus(a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        lanes!(I => a[I] + b[I])
    }

    #[inline(always)]
    fn minus(a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        lanes!(I => a[I] - b[I])
    }

    #[inline(always)]
    fn pick_index(mask: [bool; LANES], yes: [i32; LANES], no: [i32; LANES]) -> [i32; LANES] {
        lanes!(I => if mask[I] { yes[I] } else { no[I] })
    }

    #[inline(always)]
    fn places(cell: [i32; LANES], cells: i32, second: [bool; LANES]) -> Places {
        let other = cells as u32 + 1;
        let at =
            lanes!(I => (cell[I] as u32).min(cells as u32) + if second[I] { other } else { 0 });
        Places { at, rows: 2 * (cells as usize + 1) }
    }

    #[inline(always)]
    fn numbered(rows: &[u32; LANES], count: usize) -> Places {
        Places { at: *rows, rows: count }
    }

    #[inline(always)]
    fn rows(table: &[[F; 4]], at: &Places) -> [Self; 4] {
        let rows = lanes!(I => table[at.at[I] as usize]);
        [
            Self(lanes!(I => rows[I][0])),
            Self(lanes!(I => rows[I][1])),
            Self(lanes!(I => rows[I][2])),
            Self(lanes!(I => rows[I][3])),
        ]
    }

    #[inline(always)]
    fn add_to_rows(table: &mut [[F; 4]], at: &Places, columns: [Self; 4]) {
        let [Self(a), Self(b), Self(c), Self(d)] = columns;
        lanes!(I => {
            let row = &mut table[at.at[I] as usize];
            *row = [row[0] + a[I], row[1] + b[I], row[2] + c[I], row[3] + d[I]];
        });
    }
}
