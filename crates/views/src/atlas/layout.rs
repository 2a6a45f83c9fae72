//! The parts of an atlas, and where they lie.

use std::collections::HashMap;

use image::{Rgb, RgbImage};
use softrast_mesh::{Mesh, Texture, from_linear, to_linear};

use super::{
    pictures::Pictures,
    texels::{Bounds, between, bounds, from, repeated, shifted, size, texels, texels_in, union},
};

/// Colour and factor that change nothing.
pub(super) const WHITE: [f64; 3] = [1.0; 3];
/// sRGB colour of faces without picture and colours.
pub(super) const GREY: [f64; 3] = [0.7; 3];
/// Texels along a side of the square of a face whose colours differ between corners.
const SMALLEST: usize = 4;

/// A part of the atlas.
#[derive(Clone, Copy)]
struct Patch {
    size: [usize; 2],
    fill: Fill,
}

/// The content of a patch.
#[derive(Clone, Copy)]
enum Fill {
    /// The picture of a material from this texel on.
    Cut { material: usize, low: [i64; 2] },
    /// A face, with its first corner at the upper left, the second at the right, the third below: linear colours of its corners, times the
    /// picture of a material, on which the corners are at these texels.
    Face { light: [[f64; 3]; 3], shown: Option<(usize, [[f64; 2]; 3])> },
}

/// The patches, and the positions of faces on them.
pub(super) struct Layout {
    patches: Vec<Patch>,
    /// The patch of each face, and its corners in texels from the patch's upper left corner.
    faces: Vec<(usize, [[f64; 2]; 3])>,
}

/// Positions of patches.
pub(super) struct Packed {
    pub(super) width: usize,
    pub(super) height: usize,
    at: Vec<[usize; 2]>,
}

impl Layout {
    pub(super) fn of(mesh: &Mesh, texture: &Texture, pictures: &Pictures) -> Self {
        let mut layout = Self { patches: vec![], faces: Vec::with_capacity(mesh.faces().len()) };
        let shared = layout.add_shared(mesh, texture, pictures);
        let mut flat = HashMap::new();
        for (face, uv) in uv_of_faces(texture).enumerate() {
            let number = texture.of_faces()[face] as usize;
            let (material, picture) = (&texture.materials()[number], pictures.of_material(number));
            let is_lit = picture.is_none() || texture.multiplies_colours();
            let colours = mesh.colours().filter(|_| is_lit);
            let next = layout.patches.len();
            if let (Some(picture), None) = (picture, colours) {
                let corners = shifted(uv.map(|uv| texels(uv, picture)), picture);
                let (patch, low) = shared[number].unwrap_or_else(|| {
                    let around = bounds(corners);
                    let fill = Fill::Cut { material: number, low: around[0] };
                    layout.patches.push(Patch { size: size(around), fill });
                    (next, around[0])
                });
                layout.faces.push((patch, from(corners, low)));
                continue;
            }
            let plain = if picture.is_none() && material.factor() == WHITE { GREY } else { WHITE };
            let light = [0, 1, 2].map(|k| {
                let own = colours.map_or(plain, |all| all[mesh.faces()[face][k] as usize]);
                [0, 1, 2].map(|c| to_linear(own[c]) * material.factor()[c])
            });
            let shown = picture.map(|picture| (number, uv.map(|uv| texels(uv, picture))));
            let longest = shown.map_or(0.0, |(_, corners)| {
                let edge = |k: usize| length(corners[k], corners[(k + 1) % 3]);
                (0..3).map(edge).fold(0.0, f64::max)
            });
            let fill = Fill::Face { light, shown };
            if shown.is_none() && light[0] == light[1] && light[1] == light[2] {
                let patch = *flat.entry(light[0].map(f64::to_bits)).or_insert(next);
                if patch == next {
                    layout.patches.push(Patch { size: [2; 2], fill });
                }
                layout.faces.push((patch, [[1.0; 2]; 3]));
                continue;
            }
            let side = SMALLEST.max(longest.ceil() as usize + 1);
            layout.patches.push(Patch { size: [side; 2], fill });
            let far = side as f64 - 0.5;
            layout.faces.push((next, [[0.5, 0.5], [far, 0.5], [0.5, far]]));
        }
        layout
    }

    /// Adds a patch for each material whose faces overlap so much that one patch for all of them is smaller than one for each. Returns the
    /// patch and its first texel for each of these materials.
    fn add_shared(
        &mut self,
        mesh: &Mesh,
        texture: &Texture,
        pictures: &Pictures,
    ) -> Vec<Option<(usize, [i64; 2])>> {
        let materials = texture.materials().len();
        if texture.multiplies_colours() && mesh.colours().is_some() {
            return vec![None; materials];
        }
        let mut all: Vec<Option<(Bounds, f64)>> = vec![None; materials];
        for (uv, &number) in uv_of_faces(texture).zip(texture.of_faces()) {
            let Some(picture) = pictures.of_material(number as usize) else { continue };
            let own = bounds(shifted(uv.map(|uv| texels(uv, picture)), picture));
            let (around, sum) = all[number as usize].get_or_insert((own, 0.0));
            *around = union(*around, own);
            *sum += texels_in(own);
        }
        let mut add = |(number, found): (usize, Option<(Bounds, f64)>)| {
            let (around, _) = found.filter(|&(around, sum)| texels_in(around) <= sum)?;
            let fill = Fill::Cut { material: number, low: around[0] };
            self.patches.push(Patch { size: size(around), fill });
            Some((self.patches.len() - 1, around[0]))
        };
        all.into_iter().enumerate().map(&mut add).collect()
    }

    /// Packs patches on shelves, the highest first.
    pub(super) fn packed(&self) -> Packed {
        let mut order = Vec::from_iter(0..self.patches.len());
        order.sort_by_key(|&k| std::cmp::Reverse(self.patches[k].size[1]));
        let texels: f64 =
            self.patches.iter().map(|patch| (patch.size[0] as f64) * patch.size[1] as f64).sum();
        let widest = self.patches.iter().map(|patch| patch.size[0]).max().unwrap_or(1);
        let width = widest.max(texels.sqrt().ceil() as usize);
        let mut at = vec![[0; 2]; self.patches.len()];
        let ([mut x, mut y], mut shelf) = ([0, 0], 0);
        for k in order {
            let [wide, high] = self.patches[k].size;
            if x + wide > width {
                (x, y, shelf) = (0, y + shelf, 0);
            }
            at[k] = [x, y];
            shelf = shelf.max(high);
            x += wide;
        }
        Packed { width, height: (y + shelf).max(1), at }
    }

    /// The picture.
    pub(super) fn drawn(
        &self,
        packed: &Packed,
        texture: &Texture,
        pictures: &Pictures,
    ) -> RgbImage {
        let mut picture = RgbImage::new(packed.width as u32, packed.height as u32);
        for (patch, &[left, top]) in self.patches.iter().zip(&packed.at) {
            for y in 0..patch.size[1] {
                for x in 0..patch.size[0] {
                    let colour = patch.texel([x, y], texture, pictures);
                    picture.put_pixel((left + x) as u32, (top + y) as u32, Rgb(colour));
                }
            }
        }
        picture
    }

    /// The (u, v) of the corners of all faces, and for each face three indices into them.
    pub(super) fn coordinates(&self, packed: &Packed) -> (Vec<[f64; 2]>, Vec<[u32; 3]>) {
        let [width, height] = [packed.width, packed.height].map(|side| side as f64);
        let place = |&(patch, corners): &(usize, [[f64; 2]; 3])| {
            let [left, top] = packed.at[patch].map(|k| k as f64);
            corners.map(|[x, y]| [(left + x) / width, 1.0 - (top + y) / height])
        };
        let corners = (0..self.faces.len() as u32).map(|face| [0, 1, 2].map(|k| 3 * face + k));
        (self.faces.iter().flat_map(place).collect(), corners.collect())
    }
}

impl Patch {
    /// The colour of a texel.
    fn texel(&self, [x, y]: [usize; 2], texture: &Texture, pictures: &Pictures) -> [u8; 3] {
        match self.fill {
            Fill::Cut { material, low } => {
                let Some(picture) = pictures.of_material(material) else { return [0; 3] };
                let levels = repeated(picture, low[0] + x as i64, low[1] + y as i64);
                let factor = texture.materials()[material].factor();
                if factor == WHITE {
                    return levels;
                }
                let share = |k: usize| to_linear(f64::from(levels[k]) / 255.0) * factor[k];
                [0, 1, 2].map(|k| byte(from_linear(share(k))))
            }
            Fill::Face { light, shown } => {
                let [right, down] = [x, y].map(|k| k as f64 / (self.size[0] - 1) as f64);
                let weights = [1.0 - right - down, right, down];
                let sum = |of: [f64; 3]| (0..3).map(|k| weights[k] * of[k]).sum::<f64>();
                let light = [0, 1, 2].map(|c| sum(light.map(|colour| colour[c])).clamp(0.0, 1.0));
                let picture = shown.and_then(|(material, corners)| {
                    let place = [0, 1].map(|k| sum(corners.map(|corner| corner[k])));
                    Some(between(place, pictures.of_material(material)?))
                });
                let levels = picture.unwrap_or(WHITE);
                [0, 1, 2].map(|c| byte(from_linear(to_linear(levels[c]) * light[c])))
            }
        }
    }
}

pub(super) fn byte(level: f64) -> u8 {
    (255.0 * level.clamp(0.0, 1.0)).round() as u8
}

fn length(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

fn uv_of_faces(texture: &Texture) -> impl Iterator<Item = [[f64; 2]; 3]> {
    let at = |k: u32| texture.coordinates()[k as usize];
    texture.corners().iter().map(move |corners| corners.map(at))
}
