//! How many pixel-face pairs a walk visits: its work, without its arithmetic.

use rayon::prelude::*;

use super::{
    face::Faces,
    float::Float,
    lanes::{LANES, Lanes as _, Plain},
    list::rows_from_origin,
    reach::within,
    real::splat,
    scene::Scene,
    sum::Inputs,
};

/// Number of pixel-face pairs over all views that one walk visits; the table is not read.
pub(crate) fn pairs<F: Float>(inputs: &Inputs<F>) -> usize {
    let bands = inputs.bands();
    let scene: Scene<Plain<F>> = inputs.scene([&[]; 2]);
    let views = bands.views.len();
    let in_view = |(index, view)| {
        let in_band = |band: usize| {
            let place = scene.place(view, index, views, band);
            let mut pairs = 0;
            let mut prepared = Faces::nothing();
            for numbers in place.view.faces(band).chunks(LANES) {
                let spans = place.faces(&scene, numbers, &mut prepared);
                for (lane, &number) in numbers.iter().enumerate() {
                    let reach = place.view.reaches[number as usize];
                    let rows = within(scene.band_rows(band), reach).len();
                    let width = splat::<Plain<F>>(f64::from(reach.right - reach.left));
                    for row in (0..rows).step_by(LANES) {
                        let y = rows_from_origin::<Plain<F>>() + splat(row as f64);
                        let [starts, ends] =
                            spans.columns(lane, y, width).map(|columns| columns.nearest());
                        let lengths =
                            starts.iter().zip(ends).map(|(start, end)| (end - start).max(0));
                        pairs += lengths.take(rows - row).sum::<i32>() as usize;
                    }
                }
            }
            pairs
        };
        (0..bands.count).map(in_band).sum::<usize>()
    };
    bands.views.par_iter().enumerate().map(in_view).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Grid;

    const TRIANGLE: [f64; 9] = [-0.5, 0.5, -0.5, -0.5, -0.5, 0.5, 2.0, 2.0, 2.0];
    const SIZE: usize = 40;

    fn pairs_within(radius: f64, vertices: &[f64], views: usize) -> usize {
        let grid = Grid { outer: radius, inner: 1.0, from: [0.0; 2], octaves: 4, far: 0, bits: 2 };
        let faces = &[[0, 1, 2]];
        let size = SIZE.into();
        pairs(&Inputs { vertices, table: &[], faces, grid, size, near: 0.1, views, rows: 16 })
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
