//! Colours of texels, and which of them are read.

use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};
use softrast_mesh::{Mesh, Texture};
use softrast_views::{Unwrapped, covered_texels};

use crate::cuts::parts;

/// Rings of texels around a chart that are read between texels.
const RINGS: usize = 2;

/// Texels of a square picture, row by row from the top.
#[derive(Clone, Debug)]
pub(super) struct Texels {
    pub(super) size: usize,
    /// Red, green and blue, those of the first texel first.
    pub(super) colours: Vec<f32>,
    /// Whether a texel lies on a chart or in a ring around one.
    pub(super) is_read: Vec<bool>,
}

impl Texels {
    /// The colours of the vertices of `fine`, which is the mesh of the layout, after this many [cuts](crate::cuts::cuts). Rings have the mean of the texels beside them.
    pub(super) fn of(layout: &Unwrapped, fine: &Mesh, cuts: u32) -> Self {
        let (size, colours) = (layout.size(), fine.colours().unwrap_or_default());
        let mut texels =
            Self { size, colours: vec![0.0; 3 * size * size], is_read: vec![false; size * size] };
        let along = f64::from(1u32 << cuts);
        for (number, &face) in layout.corners().iter().enumerate() {
            parts(number, cuts, &mut |part, shares| {
                let places = shares.map(|of: [f64; 3]| {
                    [0, 1].map(|k| (0..3).map(|i| of[i] * face[i][k]).sum::<f64>() / along)
                });
                let of = fine.faces()[part].map(|vertex| colours[vertex as usize]);
                covered_texels(places, |[x, y], shares| {
                    let texel = y as usize * size + x as usize;
                    texels.is_read[texel] = true;
                    let mix = |k: usize| (0..3).map(|i| shares[i] * of[i][k]).sum::<f64>() as f32;
                    let own = &mut texels.colours[3 * texel..3 * texel + 3];
                    own.iter_mut().enumerate().for_each(|(k, level)| *level = mix(k));
                });
            });
        }
        (0..RINGS).for_each(|_| texels.widen());
        texels
    }

    /// Gives each texel beside those that are read the mean of these.
    fn widen(&mut self) {
        let (size, before) = (self.size, self.is_read.clone());
        for texel in 0..size * size {
            if before[texel] {
                continue;
            }
            let (x, y) = (texel % size, texel / size);
            let near = |at: usize| at.saturating_sub(1)..(at + 2).min(size);
            let (mut sum, mut count) = ([0.0; 3], 0.0f32);
            for other in near(y).flat_map(|y| near(x).map(move |x| y * size + x)) {
                if before[other] {
                    (0..3).for_each(|k| sum[k] += self.colours[3 * other + k]);
                    count += 1.0;
                }
            }
            if count > 0.0 {
                self.is_read[texel] = true;
                (0..3).for_each(|k| self.colours[3 * texel + k] = sum[k] / count);
            }
        }
    }

    /// Gives all other texels colours of those around, so that a picture of a fraction of the size shows no seam.
    pub(super) fn fill(&mut self) {
        let weights: Vec<f32> = self.is_read.iter().map(|&is| f32::from(u8::from(is))).collect();
        let filled = filled(self.size, &self.colours, &weights);
        for (texel, _) in self.is_read.iter().enumerate().filter(|(_, is_read)| !**is_read) {
            (0..3).for_each(|k| self.colours[3 * texel + k] = filled[3 * texel + k]);
        }
    }

    /// The mesh without colours of vertices, with the picture of these texels, in 8 bits, as a PNG file.
    pub(super) fn on(&self, mesh: &Mesh, layout: &Unwrapped) -> anyhow::Result<Mesh> {
        let picture = RgbImage::from_fn(self.size as u32, self.size as u32, |x, y| {
            let first = 3 * (y as usize * self.size + x as usize);
            Rgb([0, 1, 2].map(|k| (255.0 * self.colours[first + k].clamp(0.0, 1.0)).round() as u8))
        });
        let mut file = Vec::new();
        picture.write_to(&mut Cursor::new(&mut file), ImageFormat::Png)?;
        let corners = (0..mesh.faces().len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]);
        let texture = Texture::new(layout.coordinates(), corners.collect())?.with_picture(file)?;
        let bare = Mesh::new(mesh.positions().to_vec(), mesh.faces().to_vec())?;
        Ok(bare.with_texture(texture)?)
    }
}

/// Means of 2 × 2 texels that have a weight, halved again and again; texels without a weight take those of the halved picture.
fn filled(size: usize, colours: &[f32], weights: &[f32]) -> Vec<f32> {
    if size < 2 || weights.iter().all(|&weight| weight > 0.0) {
        return colours.to_vec();
    }
    let half = size.div_ceil(2);
    let (mut sums, mut counts) = (vec![0.0; 3 * half * half], vec![0.0f32; half * half]);
    for (texel, &weight) in weights.iter().enumerate() {
        let to = texel / size / 2 * half + texel % size / 2;
        counts[to] += weight;
        (0..3).for_each(|k| sums[3 * to + k] += weight * colours[3 * texel + k]);
    }
    for (sum, count) in sums.chunks_mut(3).zip(&mut counts) {
        if *count > 0.0 {
            sum.iter_mut().for_each(|sum| *sum /= *count);
            *count = 1.0;
        }
    }
    let coarse = filled(half, &sums, &counts);
    let of = |(k, &colour): (usize, &f32)| {
        let texel = k / 3;
        let from = texel / size / 2 * half + texel % size / 2;
        if weights[texel] > 0.0 { colour } else { coarse[3 * from + k % 3] }
    };
    colours.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;
    use softrast_views::Atlas;

    use super::*;

    #[test]
    fn texels_show_the_colours_of_vertices_of_the_mesh_and_of_one_that_was_cut() {
        for cuts in 0..3 {
            let ball = icosphere(2);
            let fine = (0..cuts).fold(ball.clone(), |mesh, _| mesh.subdivided());
            let colour = |p: &[f64; 3]| p.map(|x| 0.5 + 0.4 * x);
            let colours = fine.positions().iter().map(colour).collect();
            let fine = fine.with_colours(colours).unwrap();
            let layout = Unwrapped::of(&ball, 200).unwrap();
            let mut texels = Texels::of(&layout, &fine, cuts);
            texels.fill();
            let textured = texels.on(&ball, &layout).unwrap();
            let atlas = Atlas::of(&textured, 1 << 20).0.unwrap();
            for (triangle, corners) in ball.triangles().zip(atlas.corners()) {
                for (p, &corner) in triangle.iter().zip(corners) {
                    let found = atlas.colour_at(atlas.coordinates()[corner as usize]);
                    let known = colour(p);
                    // Rings go on as the texels beside them are.
                    assert!(
                        (0..3).all(|k| (found[k] - known[k]).abs() < 0.02),
                        "{found:?} {known:?}"
                    );
                }
            }
            // Nothing is left black, and what is between charts is like one of them.
            assert!(texels.colours.iter().all(|&x| (0.09..=0.91).contains(&x)));
        }
    }
}
