#![allow(clippy::needless_range_loop, clippy::assign_op_pattern)]

use std::ops::{Add, AddAssign, Mul, Sub};

use super::{Float, GROUP, LANES, Lanes, Places, lanes};

/// A vector as an array, for every machine.
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
    // f32 has explicit vectors for AVX2.
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
