//! Eight `f32` in two vectors of WebAssembly.
//!
//! Browsers validate a module as a whole, so this is compiled in only with `-C target-feature=+simd128`, without detection at run time. The
//! page in `web` tests it: its steps have the same bits as those of native code.

use std::{
    arch::wasm32::*,
    ops::{Add, AddAssign, Mul, Sub},
};

use bytemuck::cast;

use super::{GROUP, LANES, Lanes, Places};

/// Eight `f32`, the first four lanes first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x8([v128; 2]);

/// Applies an operation to both vectors.
macro_rules! both {
    ($function:ident($($argument:expr),+)) => {
        [$function($($argument[0]),+), $function($($argument[1]),+)]
    };
}

macro_rules! operator {
    ($trait:ident, $function:ident, $operation:ident) => {
        impl $trait for F32x8 {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(both!($operation(self.0, other.0)))
            }
        }
    };
}

operator!(Add, add, f32x4_add);
operator!(Sub, sub, f32x4_sub);
operator!(Mul, mul, f32x4_mul);

impl AddAssign for F32x8 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Lanes for F32x8 {
    type Float = f32;
    type Mask = [v128; 2];
    type Index = [v128; 2];
    type Which = [[v128; 2]; 2];
    const NEEDS_AVX2: bool = false;
    const GAINS_AVX2: bool = false;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([f32x4_splat(value); 2])
    }

    #[inline(always)]
    fn of(values: &[f32; LANES]) -> Self {
        Self(cast(*values))
    }

    #[inline(always)]
    fn array(self) -> [f32; LANES] {
        cast(self.0)
    }

    #[inline(always)]
    fn of_groups(low: &[f32; GROUP], high: &[f32; GROUP]) -> Self {
        Self([cast(*low), cast(*high)])
    }

    #[inline(always)]
    fn add_to_groups(self, numbers: &mut [f32], at: [u32; 2]) {
        for (half, at) in self.0.into_iter().zip(at) {
            if let Some(group) = numbers[at as usize..].first_chunk_mut::<GROUP>() {
                *group = cast(f32x4_add(cast(*group), half));
            }
        }
    }

    #[inline(always)]
    fn recip(self) -> Self {
        let one = Self::splat(1.0);
        Self(both!(f32x4_div(one.0, self.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(both!(f32x4_sqrt(self.0)))
    }

    #[inline(always)]
    fn neg(self) -> Self {
        Self(both!(f32x4_neg(self.0)))
    }

    // `pmin(a, b)` is b where it is less, else a.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(both!(f32x4_pmin(other.0, self.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(both!(f32x4_pmax(other.0, self.0)))
    }

    #[inline(always)]
    fn less(self, other: Self) -> [v128; 2] {
        both!(f32x4_lt(self.0, other.0))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> [v128; 2] {
        both!(f32x4_le(self.0, other.0))
    }

    #[inline(always)]
    fn pick(mask: [v128; 2], yes: Self, no: Self) -> Self {
        Self(both!(v128_bitselect(yes.0, no.0, mask)))
    }

    #[inline(always)]
    fn only(self, mask: [v128; 2]) -> Self {
        Self(both!(v128_and(self.0, mask)))
    }

    #[inline(always)]
    fn which(second: [v128; 2], third: [v128; 2]) -> [[v128; 2]; 2] {
        [second, third]
    }

    #[inline(always)]
    fn where_each(second: [v128; 2], third: [v128; 2]) -> [[v128; 2]; 3] {
        let either = both!(v128_or(second, third));
        [both!(v128_not(either)), both!(v128_andnot(second, third)), third]
    }

    #[inline(always)]
    fn chosen(&[a, b, c, _]: &[f32; 4], [second, third]: [[v128; 2]; 2]) -> Self {
        Self::pick(third, Self::splat(c), Self::pick(second, Self::splat(b), Self::splat(a)))
    }

    #[inline(always)]
    fn to_rows([a, b, c]: [Self; 3], to: &mut [[f32; 4]; LANES]) {
        for half in 0..2 {
            let rows = transposed([a.0[half], b.0[half], c.0[half], f32x4_splat(0.0)]);
            for (row, numbers) in to[half * GROUP..].iter_mut().zip(rows) {
                *row = cast(numbers);
            }
        }
    }

    #[inline(always)]
    fn bits(mask: [v128; 2]) -> u32 {
        let [low, high] = both!(i32x4_bitmask(mask));
        u32::from(low) | u32::from(high) << GROUP
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let four = f32x4_add(self.0[0], self.0[1]);
        let two = f32x4_add(four, i32x4_shuffle::<2, 3, 0, 1>(four, four));
        f32x4_extract_lane::<0>(two) + f32x4_extract_lane::<1>(two)
    }

    // As for plain floats: adding a large number leaves the integer in the low bits.
    #[inline(always)]
    fn nearest(self) -> [v128; 2] {
        let shift = [f32x4_splat(8_388_608.0); 2];
        let shifted = both!(f32x4_add(self.0, shift));
        both!(i32x4_sub(shifted, shift))
    }

    #[inline(always)]
    fn rounded(self) -> Self {
        Self(both!(f32x4_nearest(self.0)))
    }

    #[inline(always)]
    fn pack(keep: [v128; 2], numbers: [[v128; 2]; 2], mut to: [&mut [u32; LANES]; 2]) -> usize {
        let mut count = 0;
        for half in 0..2 {
            let mask = i32x4_bitmask(keep[half]) as usize % KEPT.len();
            let order = cast(KEPT[mask]);
            for (numbers, to) in numbers.iter().zip(&mut to) {
                // The second half starts at the fifth position at most.
                if let Some(group) = to[count..].first_chunk_mut::<GROUP>() {
                    *group = cast(i8x16_swizzle(numbers[half], order));
                }
            }
            count += mask.count_ones() as usize;
        }
        count
    }

    #[inline(always)]
    fn pixels(places: &[u32; 2]) -> (Self, Self) {
        let places = places.map(|place| u32x4_splat(place));
        let [below, along] = [[u32x4_splat(0x00ff_ffff); 2], [u32x4(0, 1, 2, 3); 2]];
        let columns = both!(v128_and(places, below));
        let columns = both!(i32x4_add(columns, along));
        let rows = places.map(|places| u32x4_shr(places, 24));
        (Self(both!(f32x4_convert_i32x4(columns))), Self(both!(f32x4_convert_i32x4(rows))))
    }

    #[inline(always)]
    fn cell(self, octaves: u32, bits: u32) -> ([v128; 2], Self, Self) {
        let first = i32x4_splat((127 - octaves as i32) << bits);
        let one = f32x4_splat(1.0);
        let [mantissa, most] = [u32x4_splat(0x007f_ffff), i32x4_splat(254 + bits as i32)];
        let index = |raw| i32x4_sub(u32x4_shr(raw, 23 - bits), first);
        let place = |raw| {
            let rest = v128_and(i32x4_shl(raw, bits), mantissa);
            f32x4_sub(v128_or(rest, one), one)
        };
        let inverse = |raw| i32x4_shl(i32x4_sub(most, u32x4_shr(raw, 23)), 23);
        (self.0.map(index), Self(self.0.map(place)), Self(self.0.map(inverse)))
    }

    #[inline(always)]
    fn index(value: i32) -> [v128; 2] {
        [i32x4_splat(value); 2]
    }

    #[inline(always)]
    fn indices(values: &[i32; LANES]) -> [v128; 2] {
        cast(*values)
    }

    #[inline(always)]
    fn index_array(index: [v128; 2]) -> [i32; LANES] {
        cast(index)
    }

    #[inline(always)]
    fn plus(a: [v128; 2], b: [v128; 2]) -> [v128; 2] {
        both!(i32x4_add(a, b))
    }

    #[inline(always)]
    fn minus(a: [v128; 2], b: [v128; 2]) -> [v128; 2] {
        both!(i32x4_sub(a, b))
    }

    #[inline(always)]
    fn pick_index(mask: [v128; 2], yes: [v128; 2], no: [v128; 2]) -> [v128; 2] {
        both!(v128_bitselect(yes, no, mask))
    }

    #[inline(always)]
    fn places(cell: [v128; 2], cells: i32, second: [v128; 2]) -> Places {
        let [last, side] = [cells, cells + 1].map(|number| [i32x4_splat(number); 2]);
        let (cell, side) = (both!(u32x4_min(cell, last)), both!(v128_and(second, side)));
        Places { at: cast(both!(i32x4_add(cell, side))), rows: 2 * (cells as usize + 1) }
    }

    #[inline(always)]
    fn numbered(rows: &[u32; LANES], count: usize) -> Places {
        Places { at: *rows, rows: count }
    }

    #[inline(always)]
    fn rows(table: &[[f32; 4]], at: &Places) -> [Self; 4] {
        let half = |first: usize| {
            transposed([0, 1, 2, 3].map(|lane| cast(table[at.at[first + lane] as usize])))
        };
        let (low, high) = (half(0), half(GROUP));
        [0, 1, 2, 3].map(|column| Self([low[column], high[column]]))
    }

    #[inline(always)]
    fn add_to_rows(table: &mut [[f32; 4]], at: &Places, columns: [Self; 4]) {
        for half in 0..2 {
            let rows = transposed(columns.map(|column| column.0[half]));
            for (numbers, at) in rows.into_iter().zip(&at.at[half * GROUP..]) {
                let row = &mut table[*at as usize];
                *row = cast(f32x4_add(cast(*row), numbers));
            }
        }
    }
}

/// For each mask of four lanes, the bytes of those where it holds, in ascending order; then zeros.
static KEPT: [[u8; 16]; 16] = {
    let mut all = [[0x80; 16]; 16];
    let mut mask = 0;
    while mask < 16 {
        let (mut byte, mut count) = (0, 0);
        while byte < 16 {
            if mask >> (byte / 4) & 1 == 1 {
                all[mask][count] = byte as u8;
                count += 1;
            }
            byte += 1;
        }
        mask += 1;
    }
    all
};

/// Rows to columns.
#[inline(always)]
fn transposed([a, b, c, d]: [v128; 4]) -> [v128; 4] {
    let [ab, cd] = [[a, b], [c, d]]
        .map(|[a, b]| [i32x4_shuffle::<0, 4, 1, 5>(a, b), i32x4_shuffle::<2, 6, 3, 7>(a, b)]);
    [
        i64x2_shuffle::<0, 2>(ab[0], cd[0]),
        i64x2_shuffle::<1, 3>(ab[0], cd[0]),
        i64x2_shuffle::<0, 2>(ab[1], cd[1]),
        i64x2_shuffle::<1, 3>(ab[1], cd[1]),
    ]
}
