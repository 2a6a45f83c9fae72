use std::ops::Range;

use rayon::prelude::*;
use softrast_mesh::Mesh;
use softrast_raster::{ImageSize, NEAR, Pinhole};

use crate::{Atlas, Frame};

/// Samples along each side of a pixel, unless there are too many.
const SAMPLES: usize = 4;
/// Rows of pixels that are drawn together.
const BAND: usize = 16;
/// Samples of an image at most. Larger pictures have fewer in a pixel, but one.
const MOST_SAMPLES: usize = 1 << 24;

/// Renders a coloured mesh without softness: red, green and blue over black, then the fraction of each pixel that the mesh covers; each row
/// by row from the top, from 0 to 1.
///
/// A pixel is the mean of 4 × 4 samples, of fewer if a picture has more than a million pixels. A sample has the colour of the nearest face,
/// interpolated in perspective. A mesh without colours is white. Faces with a corner behind the camera are not drawn. Mesh and camera may
/// be anywhere, in any unit.
pub fn coloured_pixels(mesh: &Mesh, camera: &Pinhole) -> [Vec<f64>; 4] {
    shown_pixels(mesh, camera, |number, weights| {
        let corners = mesh.faces()[number];
        let colours = corners.map(|v| mesh.colours().map_or([1.0; 3], |all| all[v as usize]));
        [0, 1, 2].map(|k| (0..3).map(|corner| weights[corner] * colours[corner][k]).sum::<f64>())
    })
}

/// Renders a mesh with this atlas, as [`coloured_pixels`] does: a sample has the colour between its texels.
///
/// # Panics
///
/// If the atlas is that of a mesh of fewer faces.
pub fn textured_pixels(mesh: &Mesh, atlas: &Atlas, camera: &Pinhole) -> [Vec<f64>; 4] {
    shown_pixels(mesh, camera, |number, weights| {
        let corners = atlas.corners()[number].map(|k| atlas.coordinates()[k as usize]);
        let sum = |k: usize| (0..3).map(|corner| weights[corner] * corners[corner][k]).sum();
        atlas.colour_at([0, 1].map(sum))
    })
}

/// Renders faces whose colour is a function of their number and of the weights of their corners.
fn shown_pixels(
    mesh: &Mesh,
    camera: &Pinhole,
    colour: impl Fn(usize, [f64; 3]) -> [f64; 3] + Sync,
) -> [Vec<f64>; 4] {
    let pixels = camera.size.pixels();
    let each = (1..=SAMPLES).rev().find(|n| n * n * pixels <= MOST_SAMPLES).unwrap_or(1);
    let share = 1.0 / (each * each) as f64;
    let samples = Samples::new(mesh, camera, each);
    let columns = camera.size.width;
    // Samples of a few rows at a time: those of a whole picture take up to half a gigabyte.
    let of_band = |band: usize| {
        let nearest = samples.band(band, [0.0; 3], &colour);
        let mut pixels = vec![[0.0; 4]; nearest.len() / (each * each)];
        let (width, shown) =
            (each * columns, |sample: &(usize, (f64, [f64; 3]))| sample.1.0.is_finite());
        for (k, (_, [r, g, b])) in nearest.into_iter().enumerate().filter(shown) {
            let pixel = &mut pixels[k / width / each * columns + k % width / each];
            for (channel, value) in pixel.iter_mut().zip([r, g, b, 1.0]) {
                *channel += share * value;
            }
        }
        pixels
    };
    let bands: Vec<Vec<[f64; 4]>> = samples.bands().into_par_iter().map(of_band).collect();
    [0, 1, 2, 3].map(|k| bands.iter().flatten().map(|pixel| pixel[k]).collect())
}

/// The nearest face at each of `each` × `each` samples of every pixel, row by row of samples: its depth, and what `shown` makes of its number and the
/// weights of its corners in space. Where there is none, an infinite depth and `empty`.
///
/// Faces with a corner behind the camera are left out. Mesh and camera may be anywhere, in any unit.
///
/// ```
/// use softrast_mesh::icosphere;
/// use softrast_raster::Pinhole;
/// use softrast_views::nearest_samples;
///
/// let camera = Pinhole::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 8);
/// let samples = nearest_samples(&icosphere(2), &camera, 2, None, |face, _| Some(face));
/// assert_eq!(samples.len(), 16 * 16);
/// let (depth, face) = samples[8 * 16 + 8];
/// assert!((depth - 3.0).abs() < 0.05 && face.is_some());
/// assert_eq!(samples[0], (f64::INFINITY, None));
/// ```
pub fn nearest_samples<T: Copy + Send + Sync>(
    mesh: &Mesh,
    camera: &Pinhole,
    each: usize,
    empty: T,
    shown: impl Fn(usize, [f64; 3]) -> T + Sync,
) -> Vec<(f64, T)> {
    let samples = Samples::new(mesh, camera, each);
    let bands = samples.bands().into_par_iter();
    let bands: Vec<Vec<(f64, T)>> = bands.map(|band| samples.band(band, empty, &shown)).collect();
    bands.concat()
}

/// Samples of a mesh in a camera, `each` along each side of a pixel.
struct Samples<'a> {
    mesh: &'a Mesh,
    /// Columns and rows of the vertices in pixels, and their depths.
    seen: Vec<[f64; 3]>,
    near: f64,
    size: ImageSize,
    each: usize,
}

impl<'a> Samples<'a> {
    fn new(mesh: &'a Mesh, camera: &Pinhole, each: usize) -> Self {
        let near = NEAR * Frame::of_cameras(mesh, [camera]).unit;
        let seen = mesh.positions().iter().map(|&p| camera.pixel(p)).collect();
        Self { mesh, seen, near, size: camera.size, each }
    }

    fn bands(&self) -> Range<usize> {
        0..self.size.height.div_ceil(BAND)
    }

    /// Depth of the nearest face and the value of `shown` at the samples of a band of rows, row by row.
    fn band<T: Copy>(
        &self,
        band: usize,
        empty: T,
        shown: &impl Fn(usize, [f64; 3]) -> T,
    ) -> Vec<(f64, T)> {
        let Self { mesh, seen, near, size, each } = self;
        let (first, end) = (each * band * BAND, each * size.height.min((band + 1) * BAND));
        let width = each * size.width;
        let mut nearest = vec![(f64::INFINITY, empty); width * (end - first)];
        for (number, face) in mesh.faces().iter().enumerate() {
            let corners = face.map(|v| {
                let [x, y, z] = seen[v as usize];
                // The centre of the first sample is (0, 0).
                [x * *each as f64 - 0.5, y * *each as f64 - 0.5, z]
            });
            samples(corners, *near, width, first..end, |x, y, depth, weights| {
                let sample = &mut nearest[(y - first) * width + x];
                if depth < sample.0 {
                    debug_assert!(depth > 0.0, "depth {depth}");
                    *sample = (depth, shown(number, weights));
                }
            });
        }
        nearest
    }
}

/// Calls `show` for each sample of some rows inside a triangle: its column and row, its depth, and the barycentric weights in space.
///
/// Corners are columns and rows in samples, and depths; a face with a corner below `near` is skipped.
fn samples(
    corners: [[f64; 3]; 3],
    near: f64,
    width: usize,
    rows: Range<usize>,
    mut show: impl FnMut(usize, usize, f64, [f64; 3]),
) {
    let [a, b, c] = corners;
    let side = |[ax, ay, _]: [f64; 3], [bx, by, _]: [f64; 3], x: f64, y: f64| {
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let area = side(a, b, c[0], c[1]);
    let in_front = corners.iter().all(|corner| corner[2] >= near);
    if !(in_front && area != 0.0 && area.is_finite()) {
        return;
    }
    let range = |axis: usize, within: Range<usize>| {
        let [low, high] =
            corners.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| {
                [low.min(p[axis]), high.max(p[axis])]
            });
        // A cast saturates: too large numbers at the maximum, negative ones at 0.
        let (first, end) = (low.ceil().max(0.0) as usize, (high.floor() + 1.0).max(0.0) as usize);
        first.max(within.start)..end.min(within.end)
    };
    let columns = range(0, 0..width);
    for row in range(1, rows) {
        for column in columns.clone() {
            let (x, y) = (column as f64, row as f64);
            let on_screen = [side(b, c, x, y), side(c, a, x, y), side(a, b, x, y)];
            let on_screen = on_screen.map(|part| part / area);
            if on_screen.iter().any(|&part| part < 0.0) {
                continue;
            }
            // 1 / z is linear on the screen.
            let [p, q, r] = [0, 1, 2].map(|k| on_screen[k] / corners[k][2]);
            let depth = 1.0 / (p + q + r);
            show(column, row, depth, [p, q, r].map(|part| part * depth));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Pinhole {
        let rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Pinhole {
            rotation,
            translation: [0.0; 3],
            focal: [4.0; 2],
            centre: [2.0; 2],
            size: 4.into(),
        }
    }

    #[test]
    fn the_nearest_face_is_seen_and_pixels_are_means() {
        // A red half of the picture in front of a blue whole.
        let square = |low: f64, high: f64, z: f64| {
            [[low * z, -z, z], [high * z, -z, z], [high * z, z, z], [low * z, z, z]]
        };
        let positions = [square(-1.0, 1.0, 3.0), square(-1.0, 0.125, 2.0)].concat();
        let faces = vec![[4, 5, 6], [4, 6, 7], [0, 1, 2], [0, 2, 3]];
        let colours = [[[0.0, 0.0, 1.0]; 4], [[1.0, 0.0, 0.0]; 4]].concat();
        let mesh = Mesh::new(positions, faces).unwrap().with_colours(colours).unwrap();
        let [red, green, blue, covered] = coloured_pixels(&mesh, &camera());
        let close = |channel: &[f64], row: [f64; 4]| {
            channel.chunks(4).flatten().zip(row.repeat(4)).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(close(&red, [1.0, 1.0, 0.5, 0.0]), "{red:?}");
        assert!(close(&blue, [0.0, 0.0, 0.5, 1.0]), "{blue:?}");
        assert!(green.iter().all(|&x| x == 0.0) && covered.iter().all(|&x| x == 1.0));
    }

    #[test]
    fn a_texture_is_seen_between_its_texels() {
        // A floor with a picture of two texels, seen from above: red at the left, blue at the right, and a mean between them.
        let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let mesh =
            Mesh::new(positions.map(|[x, y]| [x, y, 2.0]).to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        let places = positions.map(|[x, y]| [0.5 + 0.25 * x, 0.5 - 0.5 * y]).to_vec();
        let mut picture = image::RgbImage::new(2, 1);
        (picture.get_pixel_mut(0, 0).0, picture.get_pixel_mut(1, 0).0) = ([255, 0, 0], [0, 0, 255]);
        let mut file = std::io::Cursor::new(vec![]);
        picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
        let texture = softrast_mesh::Texture::new(places, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let texture = texture.with_picture(file.into_inner()).unwrap();
        let mesh = mesh.unwrap().with_texture(texture).unwrap();
        let atlas = Atlas::of(&mesh, 100).0.unwrap();
        let [red, green, blue, covered] = textured_pixels(&mesh, &atlas, &camera());
        assert!(covered.iter().all(|&x| x == 1.0) && green.iter().all(|&x| x == 0.0));
        for (k, (red, blue)) in red.iter().zip(&blue).enumerate() {
            let expected = 0.875 - 0.25 * (k % 4) as f64;
            assert!(
                (red - expected).abs() < 1e-6 && (blue - 1.0 + expected).abs() < 1e-6,
                "{k}: {red}"
            );
        }
    }

    #[test]
    fn colours_change_in_space_and_not_on_the_screen() {
        // A floor from depth 1 to depth 3: its middle, at depth 2, appears above the middle of the screen.
        let positions = vec![[-9.0, 0.5, 1.0], [9.0, 0.5, 1.0], [9.0, 0.5, 3.0], [-9.0, 0.5, 3.0]];
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let mesh = mesh.with_colours(vec![[0.0; 3], [0.0; 3], [1.0; 3], [1.0; 3]]).unwrap();
        let camera =
            Pinhole { size: 400.into(), focal: [400.0; 2], centre: [200.0; 2], ..camera() };
        let [red, ..] = coloured_pixels(&mesh, &camera);
        // Depth 2 is in row 200 + 400 * 0.5 / 2 = 300.
        assert!((red[300 * 400 + 200] - 0.5).abs() < 0.01, "{}", red[300 * 400 + 200]);
    }

    #[test]
    fn what_is_behind_flat_or_far_off_is_not_drawn() {
        let positions = vec![[0.0, 0.0, -1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1e30, 0.0, 0.01]];
        let faces = vec![[0, 1, 2], [1, 1, 2], [1, 2, 3], [3, 3, 3]];
        let mesh = Mesh::new(positions, faces).unwrap();
        assert!(
            coloured_pixels(&mesh, &camera()).iter().flatten().all(|x| (0.0..=1.0).contains(x))
        );
    }
}
