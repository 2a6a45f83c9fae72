//! Number of pixel-face pairs that a walk visits.

use softrast_kernel::{Grid, Inputs, Kernels as _};

const TRIANGLE: [f64; 9] = [-0.5, 0.5, -0.5, -0.5, -0.5, 0.5, 2.0, 2.0, 2.0];
const SIZE: usize = 40;

fn pairs_within(radius: f64, vertices: &[f64], views: usize) -> usize {
    let grid = Grid { outer: radius, inner: 1.0, from: [0.0; 2], octaves: 4, far: 0, bits: 2 };
    let faces = &[[0, 1, 2]];
    let size = SIZE.into();
    f64::pairs(&Inputs {
        vertices,
        table: &[],
        faces,
        grid,
        size,
        near: 0.1,
        culls: false,
        views,
        bands: 3,
    })
}

#[test]
fn a_wide_radius_visits_every_pixel_of_every_view() {
    let views = [TRIANGLE, TRIANGLE].concat();
    assert_eq!(pairs_within(9.0, &views, 2), 2 * SIZE * SIZE);
}

#[test]
fn a_narrow_radius_visits_the_pixels_of_the_face() {
    // Half of a square of 20 x 20 pixels, plus the margin for rounding.
    let visited = pairs_within(1e-6, &TRIANGLE, 1);
    assert!((190..=230).contains(&visited), "{visited}");
}

#[test]
fn a_face_behind_the_camera_visits_nothing() {
    let behind = TRIANGLE.map(|x| if x == 2.0 { -2.0 } else { x });
    assert_eq!(pairs_within(9.0, &behind, 1), 0);
}
