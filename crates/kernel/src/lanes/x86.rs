//! Eight `f32` in a vector of AVX2.
//!
//! Values of this type are created only after a check that the machine has AVX2 ([`has_vectors`](super::has_vectors)), and everything is
//! inlined into functions compiled for it.
#![allow(unsafe_code)]

use std::{
    arch::x86_64::*,
    ops::{Add, AddAssign, Mul, Sub},
};

use super::{GROUP, LANES, Lanes, Places};

/// Bytes of a row of a table, as a power of two.
const ROW: i32 = 4;
/// Most cells per side of a table for which byte offsets fit 31 bits.
const MOST_CELLS: i32 = 1 << 25;

/// Eight `f32`.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct F32x8(__m256);

macro_rules! operator {
    ($trait:ident, $function:ident, $intrinsic:ident) => {
        impl $trait for F32x8 {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                // SAFETY: there is no value of this type without AVX2.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);

impl AddAssign for F32x8 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

// SAFETY, for every block below without another comment: the intrinsics need only AVX2, and without it no value of this type exists. Memory
// is accessed through arrays and slices of the right length.
impl Lanes for F32x8 {
    type Float = f32;
    type Mask = __m256;
    type Index = __m256i;
    type Which = __m256i;
    const NEEDS_AVX2: bool = true;
    const GAINS_AVX2: bool = true;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn of(values: &[f32; LANES]) -> Self {
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn array(self) -> [f32; LANES] {
        let mut values = [0.0; LANES];
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
        values
    }

    #[inline(always)]
    fn of_groups(low: &[f32; GROUP], high: &[f32; GROUP]) -> Self {
        Self(unsafe { _mm256_set_m128(_mm_loadu_ps(high.as_ptr()), _mm_loadu_ps(low.as_ptr())) })
    }

    #[inline(always)]
    fn add_to_groups(self, numbers: &mut [f32], at: [u32; 2]) {
        let halves =
            unsafe { [_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0)] };
        let low = numbers[at[0] as usize..at[0] as usize + GROUP].as_mut_ptr();
        unsafe { _mm_storeu_ps(low, _mm_add_ps(_mm_loadu_ps(low), halves[0])) };
        let high = numbers[at[1] as usize..at[1] as usize + GROUP].as_mut_ptr();
        unsafe { _mm_storeu_ps(high, _mm_add_ps(_mm_loadu_ps(high), halves[1])) };
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self(unsafe { _mm256_div_ps(_mm256_set1_ps(1.0), self.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn neg(self) -> Self {
        Self(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn less(self, other: Self) -> __m256 {
        unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> __m256 {
        unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn pick(mask: __m256, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask) })
    }

    #[inline(always)]
    fn only(self, mask: __m256) -> Self {
        Self(unsafe { _mm256_and_ps(self.0, mask) })
    }

    #[inline(always)]
    fn which(second: __m256, third: __m256) -> __m256i {
        unsafe {
            let second = _mm256_and_si256(_mm256_castps_si256(second), _mm256_set1_epi32(1));
            let third = _mm256_and_si256(_mm256_castps_si256(third), _mm256_set1_epi32(2));
            _mm256_max_epi32(second, third)
        }
    }

    #[inline(always)]
    fn where_each(second: __m256, third: __m256) -> [__m256; 3] {
        unsafe {
            let either = _mm256_or_ps(second, third);
            let all = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
            [_mm256_andnot_ps(either, all), _mm256_andnot_ps(third, second), third]
        }
    }

    #[inline(always)]
    fn chosen(numbers: &[f32; 4], which: __m256i) -> Self {
        unsafe {
            let numbers = _mm_loadu_ps(numbers.as_ptr());
            Self(_mm256_permutevar_ps(_mm256_set_m128(numbers, numbers), which))
        }
    }

    #[inline(always)]
    fn to_rows([a, b, c]: [Self; 3], to: &mut [[f32; 4]; LANES]) {
        unsafe {
            let [p, q, r, s] = transposed([a.0, b.0, c.0, _mm256_setzero_ps()]);
            _mm_storeu_ps(to[0].as_mut_ptr(), _mm256_castps256_ps128(p));
            _mm_storeu_ps(to[1].as_mut_ptr(), _mm256_castps256_ps128(q));
            _mm_storeu_ps(to[2].as_mut_ptr(), _mm256_castps256_ps128(r));
            _mm_storeu_ps(to[3].as_mut_ptr(), _mm256_castps256_ps128(s));
            _mm_storeu_ps(to[4].as_mut_ptr(), _mm256_extractf128_ps::<1>(p));
            _mm_storeu_ps(to[5].as_mut_ptr(), _mm256_extractf128_ps::<1>(q));
            _mm_storeu_ps(to[6].as_mut_ptr(), _mm256_extractf128_ps::<1>(r));
            _mm_storeu_ps(to[7].as_mut_ptr(), _mm256_extractf128_ps::<1>(s));
        }
    }

    #[inline(always)]
    fn bits(mask: __m256) -> u32 {
        unsafe { _mm256_movemask_ps(mask) as u32 }
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        unsafe {
            let four =
                _mm_add_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    // Two sums per half of a vector, so that one addition serves several of them.
    #[inline(always)]
    fn sums(of: [Self; 6]) -> [f32; 6] {
        unsafe {
            let four = |a: Self, b: Self| {
                let low = _mm256_permute2f128_ps::<0x20>(a.0, b.0);
                _mm256_add_ps(low, _mm256_permute2f128_ps::<0x31>(a.0, b.0))
            };
            let two = |a: __m256, b: __m256| {
                let low = _mm256_shuffle_ps::<0x44>(a, b);
                _mm256_add_ps(low, _mm256_shuffle_ps::<0xEE>(a, b))
            };
            let [a, b, c, d, e, f] = of;
            let (ab, cd, ef) = (four(a, b), four(c, d), four(e, f));
            let (first, last) = (two(ab, cd), two(ef, ef));
            let even = _mm256_shuffle_ps::<0x88>(first, last);
            let sums = Self(_mm256_add_ps(even, _mm256_shuffle_ps::<0xDD>(first, last)));
            let [a, c, e, _, b, d, f, _] = sums.array();
            [a, b, c, d, e, f]
        }
    }

    #[inline(always)]
    fn nearest(self) -> __m256i {
        unsafe { _mm256_cvtps_epi32(self.0) }
    }

    #[inline(always)]
    fn rounded(self) -> Self {
        Self(unsafe {
            _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0)
        })
    }

    #[inline(always)]
    fn pack(keep: __m256, [a, b]: [__m256i; 2], [to_a, to_b]: [&mut [u32; LANES]; 2]) -> usize {
        unsafe {
            let mask = _mm256_movemask_ps(keep) as usize;
            let order = _mm256_cvtepu8_epi32(_mm_loadu_si64(KEPT[mask].as_ptr()));
            let (a, b) =
                (_mm256_permutevar8x32_epi32(a, order), _mm256_permutevar8x32_epi32(b, order));
            _mm256_storeu_si256(to_a.as_mut_ptr().cast(), a);
            _mm256_storeu_si256(to_b.as_mut_ptr().cast(), b);
            COUNT[mask] as usize
        }
    }

    #[inline(always)]
    fn pixels(places: &[u32; 2]) -> (Self, Self) {
        unsafe {
            let both = _mm_loadu_si64(places.as_ptr().cast());
            let both = _mm256_permutevar8x32_epi32(
                _mm256_castsi128_si256(both),
                _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1),
            );
            let columns = _mm256_and_si256(both, _mm256_set1_epi32(0x00ff_ffff));
            let columns = _mm256_add_epi32(columns, _mm256_setr_epi32(0, 1, 2, 3, 0, 1, 2, 3));
            let rows = _mm256_srli_epi32::<24>(both);
            (Self(_mm256_cvtepi32_ps(columns)), Self(_mm256_cvtepi32_ps(rows)))
        }
    }

    #[inline(always)]
    fn cell(self, octaves: u32, bits: u32) -> (__m256i, Self, Self) {
        unsafe {
            let raw = _mm256_castps_si256(self.0);
            // Shifts by a number per lane are one instruction, shifts by one number for all lanes are two.
            let cells = _mm256_srlv_epi32(raw, _mm256_set1_epi32(23 - bits as i32));
            let first = (127 - octaves as i32) << bits;
            let index = _mm256_sub_epi32(cells, _mm256_set1_epi32(first));
            let one = _mm256_castps_si256(_mm256_set1_ps(1.0));
            let rest = _mm256_sllv_epi32(raw, _mm256_set1_epi32(bits as i32));
            let rest = _mm256_and_si256(rest, _mm256_set1_epi32(0x007f_ffff));
            let above = _mm256_castsi256_ps(_mm256_or_si256(rest, one));
            let exponent = _mm256_srli_epi32::<23>(raw);
            let inverse = _mm256_sub_epi32(_mm256_set1_epi32(254 + bits as i32), exponent);
            let inverse = _mm256_castsi256_ps(_mm256_slli_epi32::<23>(inverse));
            (index, Self(_mm256_sub_ps(above, _mm256_set1_ps(1.0))), Self(inverse))
        }
    }

    #[inline(always)]
    fn index(value: i32) -> __m256i {
        unsafe { _mm256_set1_epi32(value) }
    }

    #[inline(always)]
    fn indices(values: &[i32; LANES]) -> __m256i {
        unsafe { _mm256_loadu_si256(values.as_ptr().cast()) }
    }

    #[inline(always)]
    fn index_array(index: __m256i) -> [i32; LANES] {
        let mut values = [0; LANES];
        unsafe { _mm256_storeu_si256(values.as_mut_ptr().cast(), index) };
        values
    }

    #[inline(always)]
    fn plus(a: __m256i, b: __m256i) -> __m256i {
        unsafe { _mm256_add_epi32(a, b) }
    }

    #[inline(always)]
    fn minus(a: __m256i, b: __m256i) -> __m256i {
        unsafe { _mm256_sub_epi32(a, b) }
    }

    #[inline(always)]
    fn pick_index(mask: __m256, yes: __m256i, no: __m256i) -> __m256i {
        unsafe { _mm256_blendv_epi8(no, yes, _mm256_castps_si256(mask)) }
    }

    #[inline(always)]
    fn places(cell: __m256i, cells: i32, second: __m256) -> Places {
        assert!((0..MOST_CELLS).contains(&cells), "a table of {cells} cells");
        let mut at = [0; LANES];
        // SAFETY: the array holds a whole vector; it need not be aligned.
        unsafe {
            let cell = _mm256_min_epu32(cell, _mm256_set1_epi32(cells));
            let side = _mm256_set1_epi32((cells + 1) << ROW);
            let side = _mm256_and_si256(_mm256_castps_si256(second), side);
            let bytes = _mm256_add_epi32(_mm256_slli_epi32::<ROW>(cell), side);
            _mm256_storeu_si256(at.as_mut_ptr().cast(), bytes);
        }
        Places { at, rows: 2 * (cells as usize + 1) }
    }

    #[inline(always)]
    fn numbered(rows: &[u32; LANES], count: usize) -> Places {
        assert!(count <= 1 << (32 - ROW), "a table of {count} rows");
        let mut at = [0; LANES];
        for i in 0..LANES {
            assert!((rows[i] as usize) < count, "row {} of {count}", rows[i]);
            at[i] = rows[i] << ROW;
        }
        Places { at, rows: count }
    }

    #[inline(always)]
    fn rows(table: &[[f32; 4]], places: &Places) -> [Self; 4] {
        assert!(places.rows <= table.len(), "places of another table");
        // SAFETY: every place is the first byte of a row below `places.rows`, or less, so the table has all that is read.
        unsafe {
            let [a, b, c, d] = transposed([
                pair_of_rows(table, places, 0),
                pair_of_rows(table, places, 1),
                pair_of_rows(table, places, 2),
                pair_of_rows(table, places, 3),
            ]);
            [Self(a), Self(b), Self(c), Self(d)]
        }
    }

    #[inline(always)]
    fn add_to_rows(table: &mut [[f32; 4]], places: &Places, [a, b, c, d]: [Self; 4]) {
        assert!(places.rows <= table.len(), "places of another table");
        // SAFETY: every place is the first byte of a row below `places.rows`, or less, so the table has all that is read.
        unsafe {
            let [a, b, c, d] = transposed([a.0, b.0, c.0, d.0]);
            add_to_row(table, places.at[0], _mm256_castps256_ps128(a));
            add_to_row(table, places.at[1], _mm256_castps256_ps128(b));
            add_to_row(table, places.at[2], _mm256_castps256_ps128(c));
            add_to_row(table, places.at[3], _mm256_castps256_ps128(d));
            add_to_row(table, places.at[4], _mm256_extractf128_ps::<1>(a));
            add_to_row(table, places.at[5], _mm256_extractf128_ps::<1>(b));
            add_to_row(table, places.at[6], _mm256_extractf128_ps::<1>(c));
            add_to_row(table, places.at[7], _mm256_extractf128_ps::<1>(d));
        }
    }

    #[inline(always)]
    fn quads(rows: &[[f32; 4]], at: [u32; 2]) -> [Self; 4] {
        let low = rows[at[0] as usize..at[0] as usize + GROUP].as_ptr();
        let high = rows[at[1] as usize..at[1] as usize + GROUP].as_ptr();
        unsafe {
            let [a, b, c, d] = transposed([
                both_rows(low, high),
                both_rows(low.add(1), high.add(1)),
                both_rows(low.add(2), high.add(2)),
                both_rows(low.add(3), high.add(3)),
            ]);
            [Self(a), Self(b), Self(c), Self(d)]
        }
    }

    #[inline(always)]
    fn add_to_quads(rows: &mut [[f32; 4]], at: [u32; 2], [a, b, c, d]: [Self; 4]) {
        unsafe {
            let [a, b, c, d] = transposed([a.0, b.0, c.0, d.0]);
            let low = rows[at[0] as usize..at[0] as usize + GROUP].as_mut_ptr().cast::<f32>();
            add_both(low, _mm256_permute2f128_ps::<0x20>(a, b));
            add_both(low.add(8), _mm256_permute2f128_ps::<0x20>(c, d));
            let high = rows[at[1] as usize..at[1] as usize + GROUP].as_mut_ptr().cast::<f32>();
            add_both(high, _mm256_permute2f128_ps::<0x31>(a, b));
            add_both(high.add(8), _mm256_permute2f128_ps::<0x31>(c, d));
        }
    }
}

/// Adds to two rows.
///
/// # Safety
///
/// Thirty-two bytes must lie there.
#[inline(always)]
unsafe fn add_both(at: *mut f32, numbers: __m256) {
    // SAFETY: the caller has checked the place.
    unsafe { _mm256_storeu_ps(at, _mm256_add_ps(_mm256_loadu_ps(at), numbers)) };
}

/// One row in the lower half and one in the upper.
///
/// # Safety
///
/// Both must be there.
#[inline(always)]
unsafe fn both_rows(low: *const [f32; 4], high: *const [f32; 4]) -> __m256 {
    // SAFETY: the caller has checked both places.
    unsafe { _mm256_set_m128(_mm_loadu_ps(high.cast()), _mm_loadu_ps(low.cast())) }
}

/// For each mask, the lanes where it holds, in ascending order.
static KEPT: [[u8; LANES]; 256] = {
    let mut all = [[0; LANES]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < LANES {
            if mask >> lane & 1 == 1 {
                all[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    all
};

/// Number of these lanes.
static COUNT: [u8; 256] = {
    let mut all = [0; 256];
    let mut mask = 0usize;
    while mask < 256 {
        all[mask] = mask.count_ones() as u8;
        mask += 1;
    }
    all
};

/// The row of lane `k` in the lower half and that of lane `k + 4` in the upper one.
///
/// # Safety
///
/// Sixteen bytes from both places on must lie in the table, and `k` be below 4.
#[inline(always)]
unsafe fn pair_of_rows(table: &[[f32; 4]], places: &Places, k: usize) -> __m256 {
    let [low, high] = [places.at[k], places.at[k + GROUP]];
    // SAFETY: the caller has checked both places.
    unsafe {
        let first = table.as_ptr().cast::<f32>();
        let low = _mm_loadu_ps(first.byte_add(low as usize));
        let high = _mm_loadu_ps(first.byte_add(high as usize));
        _mm256_set_m128(high, low)
    }
}

/// Adds to a row of a table.
///
/// # Safety
///
/// Sixteen bytes from that place on must lie in the table.
#[inline(always)]
unsafe fn add_to_row(table: &mut [[f32; 4]], at: u32, numbers: __m128) {
    // SAFETY: the caller has checked the place.
    unsafe {
        let row = table.as_mut_ptr().cast::<f32>().byte_add(at as usize);
        _mm_storeu_ps(row, _mm_add_ps(_mm_loadu_ps(row), numbers));
    }
}

/// Rows to columns, in each half.
#[inline(always)]
fn transposed([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: there is no vector without AVX2.
    unsafe {
        let ab = [_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b)];
        let cd = [_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d)];
        [
            _mm256_shuffle_ps::<0x44>(ab[0], cd[0]),
            _mm256_shuffle_ps::<0xee>(ab[0], cd[0]),
            _mm256_shuffle_ps::<0x44>(ab[1], cd[1]),
            _mm256_shuffle_ps::<0xee>(ab[1], cd[1]),
        ]
    }
}
