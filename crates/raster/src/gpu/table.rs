//! The gradient of a table: summed over the pairs of some pixels, then over all.

use cubecl::prelude::*;

use super::{
    cells::Cells,
    dual::Dual,
    frame::Frame,
    pair::{Face, Lookup},
    reach::Reach,
    tile::TILE,
};

/// Adds the gradient of the table, every unit to a table of its own over the pixels that it walks:
/// there is no order of units on which a sum could depend. `partial` is `[units, rows, 4]`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn sum_cubics(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    cells: &Array<u32>,
    upstream: &Array<f32>,
    partial: &mut Array<f32>,
    of_cells: Cells,
    lookup: Lookup,
    frame: Frame,
    first_view: u32,
    #[comptime] second: bool,
) {
    #[allow(clippy::manual_div_ceil, reason = "a shader has no other")]
    let across = (frame.width + TILE - 1u32) / TILE;
    #[allow(clippy::manual_div_ceil, reason = "a shader has no other")]
    let down = (frame.height + TILE - 1u32) / TILE;
    let tiles = of_cells.views * across * down;
    let rows = 2u32 * (lookup.cells + 1u32);
    let own = ABSOLUTE_POS as u32 * rows * 4u32;
    let stride = comptime!(if second { 12usize } else { 6usize });
    let mut tile = CUBE_POS as u32;
    while tile < tiles {
        let column = tile % across * TILE + UNIT_POS_X;
        let row = tile / across % down * TILE + UNIT_POS_Y;
        let view = tile / (across * down);
        if column < frame.width && row < frame.height {
            let px = frame.column_centre(column);
            let py = frame.row_centre(row);
            let g = upstream[frame.pixel(first_view + view, row, column) as usize];
            let first_word = of_cells.first_word(view, column, row);
            // Every pair that is not in the tail replaces one.
            let mut in_tail = of_cells.drawn(reaches, view);
            for word in 0..of_cells.words {
                let mut bits = cells[(first_word + word) as usize];
                while bits != 0 {
                    let face = 32 * word + bits.trailing_zeros();
                    bits &= bits - 1u32;
                    let face = (view * of_cells.face_count + face) as usize;
                    if Reach::load(reaches, face).holds(column, row) {
                        let pair = Face::new(corners, stride * face, second).pair(px, py, lookup);
                        if pair.row != lookup.cells {
                            in_tail -= 1u32;
                            let g = Dual::constant(g);
                            add_powers(partial, own + 4u32 * pair.row, pair.place, g, second);
                        }
                    }
                }
            }
            if !second {
                let tail = (own + 4u32 * lookup.cells) as usize;
                partial[tail] = partial[tail] + g * f32::cast_from(in_tail);
            }
        }
        tile += CUBE_COUNT as u32;
    }
}

/// Adds `g`, `g t`, `g t²` and `g t³` to four numbers from `at` on.
#[cube]
pub(super) fn add_powers(
    partial: &mut Array<f32>,
    at: u32,
    place: Dual,
    g: Dual,
    #[comptime] second: bool,
) {
    let at = at as usize;
    let first = place.mul(g);
    let square = first.mul(place);
    partial[at] = partial[at] + g.stored(second);
    partial[at + 1] = partial[at + 1] + first.stored(second);
    partial[at + 2] = partial[at + 2] + square.stored(second);
    partial[at + 3] = partial[at + 3] + square.mul(place).stored(second);
}

/// Adds up the tables of all units into `gradient`, from `offset` on: one unit a coefficient.
#[cube(launch)]
pub(super) fn sum_tables(
    partial: &Array<f32>,
    gradient: &mut Array<f32>,
    units: u32,
    coefficients: u32,
    offset: u32,
) {
    let coefficient = ABSOLUTE_POS as u32;
    if coefficient >= coefficients {
        terminate!();
    }
    let mut sum = 0.0f32;
    for unit in 0..units {
        sum += partial[(unit * coefficients + coefficient) as usize];
    }
    gradient[(offset + coefficient) as usize] = sum;
}
