//! The faces of every cell of the image, as bits.
//!
//! A bit for every cell and face has a size known beforehand, whatever the scene: nothing is
//! counted, sorted or read back, and no face is ever dropped.

use cubecl::prelude::*;

use super::reach::Reach;

/// What culling left, as the walks over pixels look it up.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub(super) struct Cells {
    /// Width and height of a cell in pixels.
    pub(super) side: u32,
    /// Cells in a row of the image, and in a column.
    pub(super) per_row: u32,
    pub(super) per_column: u32,
    /// Words of a cell, each for 32 faces.
    pub(super) words: u32,
    pub(super) face_count: u32,
    /// Views of the launch.
    pub(super) views: u32,
}

#[cube]
impl Cells {
    /// First word of the cell of a pixel.
    pub(super) fn first_word(self, view: u32, column: u32, row: u32) -> u32 {
        let row = view * self.per_column + row / self.side;
        (row * self.per_row + column / self.side) * self.words
    }

    /// Faces that the view draws.
    pub(super) fn drawn(self, reaches: &Array<u32>, view: u32) -> u32 {
        reaches[(4 * self.views * self.face_count + view) as usize]
    }
}

/// Writes 32 faces of a cell as bits, one unit each: `cells` becomes
/// `[views, rows of cells, cells of a row, words]`, a cell being `side` pixels wide and high.
#[cube(launch)]
pub(super) fn fill_cells(
    reaches: &Array<u32>,
    cells: &mut Array<u32>,
    face_count: u32,
    words: u32,
    per_row: u32,
    per_column: u32,
    side: u32,
    jobs: u32,
) {
    let job = ABSOLUTE_POS as u32;
    if job >= jobs {
        terminate!();
    }
    let word = job % words;
    let cell = job / words;
    let column = cell % per_row * side;
    let row = cell / per_row % per_column * side;
    let view = cell / (per_row * per_column);
    let mut bits = 0u32;
    for bit in 0..32u32 {
        let face = 32 * word + bit;
        if face < face_count {
            let reach = Reach::load(reaches, (view * face_count + face) as usize);
            bits |= select(reach.meets(column, row, side), 1u32, 0u32) << bit;
        }
    }
    cells[job as usize] = bits;
}
