use std::io::Cursor;

use anyhow::Context;
use image::{ImageFormat, Rgb, RgbImage};
use softrast_mesh::{Mesh, Texture};

use crate::cuts::{cuts, parts};

/// Texels that a square's side has in addition to the parts of an edge. A square holds two faces,
/// corner to corner, and interpolation within one must not read texels of the other.
const APART: usize = 3;

/// The mesh with a texture of the vertex colours of `fine`, the mesh after some calls of [`Mesh::subdivided`].
///
/// Each vertex of `fine` has a texel in each face that it lies in or on, and bilinear interpolation between texels reproduces the colours
/// of `fine`. Colours are rounded to 8 bits. Texels beyond the longest side of a face are extrapolated from it, clamped to [0, 1]: half way
/// along that side the interpolated colour may be off by a quarter of the clamped amount.
///
/// ```
/// use softrast_inverse::baked;
/// use softrast_mesh::icosphere;
///
/// let (ball, fine) = (icosphere(0), icosphere(0).subdivided());
/// let red = vec![[1.0, 0.0, 0.0]; fine.positions().len()];
/// let textured = baked(&ball, &fine.with_colours(red)?)?;
/// assert_eq!(textured.faces(), ball.faces());
/// assert!(textured.texture().unwrap().picture().is_some());
/// # anyhow::Ok(())
/// ```
///
/// # Errors
///
/// If `fine` has no colours, or is not the mesh after some subdivisions.
pub fn baked(mesh: &Mesh, fine: &Mesh) -> anyhow::Result<Mesh> {
    let colours = fine.colours().context("a mesh without colours makes no texture")?;
    let (faces, cuts) = (mesh.faces().len(), cuts(mesh, fine)?);
    let along = 1 << cuts;
    let side = along + APART;
    let squares = faces.div_ceil(2);
    let across = squares.isqrt().max(1);
    let size = [across * side, squares.div_ceil(across) * side];
    // Texels outside all faces contribute where a program downsamples the texture.
    let mean = [0, 1, 2].map(|k| {
        let sum: f64 = colours.iter().map(|colour| colour[k]).sum();
        sum / colours.len() as f64
    });
    let mut picture = RgbImage::from_pixel(size[0] as u32, size[1] as u32, rounded(mean));
    let mut coordinates = Vec::with_capacity(3 * faces);
    for face in 0..faces {
        let square = face / 2;
        let corner = [square % across * side, square / across * side];
        let place = |at: [usize; 2]| {
            [0, 1].map(|k| corner[k] + if face % 2 == 0 { at[k] } else { side - 1 - at[k] })
        };
        let mut texels = vec![[0.0; 3]; (along + 1) * (along + 1)];
        let number = |[i, j]: [usize; 2]| i * (along + 1) + j;
        let corners = [[0, 0], [along, 0], [0, along]];
        visit(fine, face, cuts, |vertex, at| texels[number(at)] = colours[vertex as usize]);
        // Beyond the long side, extrapolated for interpolation on that side.
        for i in 1..=along {
            let j = along + 1 - i;
            let [beside, below, behind] =
                [[i, j - 1], [i - 1, j], [i - 1, j - 1]].map(|at| texels[number(at)]);
            texels[number([i, j])] = [0, 1, 2].map(|k| beside[k] + below[k] - behind[k]);
        }
        for i in 0..=along {
            for j in 0..=(along + 1 - i).min(along) {
                let [x, y] = place([i, j]);
                picture.put_pixel(x as u32, y as u32, rounded(texels[number([i, j])]));
            }
        }
        coordinates.extend(corners.map(|at| {
            let [u, v] = [0, 1].map(|k| (place(at)[k] as f64 + 0.5) / size[k] as f64);
            [u, 1.0 - v]
        }));
    }
    let corners = (0..faces as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    let mut file = Vec::new();
    picture.write_to(&mut Cursor::new(&mut file), ImageFormat::Png)?;
    Ok(mesh.clone().with_texture(Texture::new(coordinates, corners)?.with_picture(file)?)?)
}

/// Calls `tell` with each vertex of the parts of a face after `cuts` subdivisions, and its place in the grid of texels, where the corners
/// of the face are (0, 0), (2^cuts, 0) and (0, 2^cuts).
fn visit(fine: &Mesh, face: usize, cuts: u32, mut tell: impl FnMut(u32, [usize; 2])) {
    parts(face, cuts, &mut |part, shares| {
        for (vertex, [_, i, j]) in fine.faces()[part].into_iter().zip(shares) {
            tell(vertex, [i as usize, j as usize]);
        }
    });
}

fn rounded(colour: [f64; 3]) -> Rgb<u8> {
    Rgb(colour.map(|x| (255.0 * x.clamp(0.0, 1.0)).round() as u8))
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    /// Bilinear interpolation at (u, v), between the centres of texels.
    fn read(picture: &RgbImage, [u, v]: [f64; 2]) -> [f64; 3] {
        let [x, y] = [u * f64::from(picture.width()), (1.0 - v) * f64::from(picture.height())];
        let [x, y] = [x - 0.5, y - 0.5].map(|at| at.max(0.0));
        let texel = |i: u32, j: u32| {
            let at = |place: f64, end: u32, next: u32| (place as u32 + next).min(end - 1);
            picture.get_pixel(at(x, picture.width(), i), at(y, picture.height(), j)).0
        };
        [0, 1, 2].map(|k| {
            let row = |j| {
                let [a, b] = [texel(0, j), texel(1, j)].map(|texel| f64::from(texel[k]) / 255.0);
                a + x.fract() * (b - a)
            };
            row(0) + y.fract() * (row(1) - row(0))
        })
    }

    #[test]
    fn what_is_read_is_the_colour_of_the_finer_mesh() {
        for cuts in 0..3 {
            let ball = icosphere(1);
            let fine = (0..cuts).fold(ball.clone(), |mesh, _| mesh.subdivided());
            let channel =
                |k: usize, vertex: usize| 0.5 + 0.1 * (1.7 * (3 * vertex + k) as f64).sin();
            let colours = 0..fine.positions().len();
            let colours = colours.map(|vertex| [0, 1, 2].map(|k| channel(k, vertex))).collect();
            let fine = fine.with_colours(colours).unwrap();
            let textured = baked(&ball, &fine).unwrap();
            let texture = textured.texture().unwrap();
            let picture = image::load_from_memory(texture.picture().unwrap()).unwrap().into_rgb8();
            let parts = 1usize << cuts;
            for (number, corners) in texture.corners().iter().enumerate() {
                let [a, b, c] = corners.map(|k| texture.coordinates()[k as usize]);
                visit(&fine, number, cuts, |vertex, [i, j]| {
                    let [s, t] = [i, j].map(|at| at as f64 / parts as f64);
                    let at = [0, 1].map(|k| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]));
                    let found = read(&picture, at);
                    let known = fine.colours().unwrap()[vertex as usize];
                    assert!(
                        (0..3).all(|k| (found[k] - known[k]).abs() < 0.003),
                        "{found:?} {known:?}"
                    );
                });
                // On the long side too, half way between the first two vertices.
                let mut ends = [[0.0; 3]; 2];
                visit(&fine, number, cuts, |vertex, at| {
                    let end = [[parts, 0], [parts - 1, 1]].iter().position(|&end| end == at);
                    if let Some(end) = end {
                        ends[end] = fine.colours().unwrap()[vertex as usize];
                    }
                });
                let found =
                    read(&picture, [0, 1].map(|k| b[k] + 0.5 / parts as f64 * (c[k] - b[k])));
                let close = |k: usize| (found[k] - 0.5 * (ends[0][k] + ends[1][k])).abs() < 0.006;
                assert!((0..3).all(close), "{found:?} {ends:?}");
            }
        }
    }

    #[test]
    fn another_mesh_is_refused() {
        let ball = icosphere(1);
        assert!(baked(&ball, &ball).is_err());
        let other = icosphere(0).subdivided();
        let colours = vec![[0.5; 3]; ball.positions().len()];
        let ball = ball.with_colours(colours).unwrap();
        assert!(baked(&other.subdivided(), &ball).is_err());
    }
}
