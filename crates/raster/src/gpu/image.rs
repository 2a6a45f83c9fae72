//! The image: one unit a pixel, over the faces of its cell.

use cubecl::prelude::*;

use super::{
    cells::Cells,
    frame::Frame,
    pair::{Cubic, Face, Lookup},
    reach::Reach,
    tile::TILE,
};

/// Writes the sum of each pixel to `sums`, all views being at `offset`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn sum_pixels(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    cells: &Array<u32>,
    table: &Array<f32>,
    direction: &Array<f32>,
    sums: &mut Array<f32>,
    of_cells: Cells,
    lookup: Lookup,
    frame: Frame,
    table_offset: u32,
    first_view: u32,
    offset: u32,
    #[comptime] second: bool,
) {
    let column = CUBE_POS_X * TILE + UNIT_POS_X;
    let row = CUBE_POS_Y * TILE + UNIT_POS_Y;
    let view = CUBE_POS_Z;
    if column >= frame.width || row >= frame.height {
        terminate!();
    }
    let px = frame.column_centre(column);
    let py = frame.row_centre(row);
    let tail = Cubic::new(table, lookup.cells, direction, table_offset, second).first();
    let drawn = f32::cast_from(of_cells.drawn(reaches, view));
    let mut sum = 0.0f32;
    let first_word = of_cells.first_word(view, column, row);
    let stride = comptime!(if second { 12usize } else { 6usize });
    for word in 0..of_cells.words {
        let mut bits = cells[(first_word + word) as usize];
        while bits != 0 {
            let face = 32 * word + bits.trailing_zeros();
            bits &= bits - 1u32;
            let face = (view * of_cells.face_count + face) as usize;
            if Reach::load(reaches, face).holds(column, row) {
                let pair = Face::new(corners, stride * face, second).pair(px, py, lookup);
                let cubic = Cubic::new(table, pair.row, direction, table_offset, second);
                sum += pair.value(cubic).sub(tail).stored(second);
            }
        }
    }
    let at = (offset + frame.pixel(first_view + view, row, column)) as usize;
    sums[at] = sum + tail.scale(drawn).stored(second);
}
