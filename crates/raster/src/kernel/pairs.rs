//! How many pixel-face pairs a walk visits: its work, without its arithmetic.

use rayon::prelude::*;

use super::{
    bands::ROWS,
    face::{Face, Spans, columns, pixel_centre, rows},
    real::Float,
    sum::Inputs,
};

/// Number of pixel-face pairs over all views that one walk visits; the table is not read.
pub(crate) fn pairs<F: Float>(inputs: &Inputs<F>) -> usize {
    let bands = inputs.bands();
    let length = inputs.vertices.len() / inputs.views.max(1);
    let per_view = bands.views.par_iter().enumerate().map(|(index, view)| {
        let vertices = &inputs.vertices[index * length..(index + 1) * length];
        let in_band = |band: usize| {
            let entries =
                &view.entries[view.offsets[band] as usize..view.offsets[band + 1] as usize];
            let of_face = |&face: &u32| {
                let corners = inputs.faces[face as usize].map(|v| &vertices[3 * v as usize..][..2]);
                face_pairs(corners, inputs, band)
            };
            entries.iter().map(of_face).sum::<usize>()
        };
        (0..bands.count).map(in_band).sum::<usize>()
    });
    per_view.sum()
}

/// Pixels of a band that one face visits.
fn face_pairs<F: Float>(corners: [&[F]; 3], inputs: &Inputs<F>, band: usize) -> usize {
    let (size, radius) = (inputs.size, inputs.grid.outer);
    let band_rows = band * ROWS..((band + 1) * ROWS).min(size);
    let mut heights = [F::ZERO; ROWS];
    for (height, row) in heights.iter_mut().zip(band_rows.clone()) {
        *height = F::from_f64(pixel_centre(size - 1 - row, size));
    }
    let [x, y] = [0, 1].map(|axis| corners.map(|corner| corner[axis]));
    let extent = |values: [F; 3]| {
        let values = values.map(F::to_f64);
        (values.into_iter().fold(f64::MAX, f64::min), values.into_iter().fold(f64::MIN, f64::max))
    };
    let ((left, right), (low, high)) = (extent(x), extent(y));
    let (top, bottom) = rows(low - radius, high + radius, size);
    let within = columns(left - radius, right + radius, size);
    let spans = Spans::new(&Face::new(x, y), F::from_f64(radius));
    let (starts, ends) = spans.columns(&heights, within, size);
    (top.max(band_rows.start)..bottom.min(band_rows.end))
        .map(|row| row - band_rows.start)
        .map(|row| (ends[row] - starts[row]).max(0) as usize)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Grid;

    const TRIANGLE: [f64; 9] = [-0.5, -0.5, 2.0, 0.5, -0.5, 2.0, -0.5, 0.5, 2.0];
    const SIZE: usize = 40;

    fn pairs_within(radius: f64, vertices: &[f64], views: usize) -> usize {
        let grid = Grid { outer: radius, inner: 1.0, octaves: 4, bits: 2 };
        let faces = &[[0, 1, 2]];
        pairs(&Inputs { vertices, table: &[], faces, grid, size: SIZE, near: 0.1, views })
    }

    #[test]
    fn a_wide_radius_visits_every_pixel_of_every_view() {
        let views = [TRIANGLE, TRIANGLE].concat();
        assert_eq!(pairs_within(9.0, &views, 2), 2 * SIZE * SIZE);
    }

    #[test]
    fn a_narrow_radius_visits_the_pixels_of_the_face() {
        // Half of a square of 20 x 20 pixels, and what the margin for rounding adds.
        let visited = pairs_within(1e-6, &TRIANGLE, 1);
        assert!((190..=230).contains(&visited), "{visited}");
    }

    #[test]
    fn a_face_behind_the_camera_visits_nothing() {
        let behind = TRIANGLE.map(|x| if x == 2.0 { -2.0 } else { x });
        assert_eq!(pairs_within(9.0, &behind, 1), 0);
    }
}
