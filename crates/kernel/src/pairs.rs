//! Number of pixel-face pairs that a walk visits: its work, without its arithmetic.

use rayon::prelude::*;

use super::{
    face::Faces,
    float::Vectors,
    lanes::{LANES, Lanes as _, Plain},
    list::rows_from_origin,
    reach::within,
    real::splat,
    scene::Scene,
    sum::Inputs,
};

/// See [`Kernels::pairs`](crate::Kernels::pairs).
pub(crate) fn pairs<F: Vectors>(inputs: &Inputs<F>) -> usize {
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
                    let rows = within(place.rows(), reach).len();
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
