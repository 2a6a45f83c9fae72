//! The viewing cone of a mask.

use softrast_mesh::Mesh;

use crate::{View, coloured_pixels, cut_sides};

/// Side length in cells of the sampled square of each mask.
const SIDE: usize = 128;
/// Distance in cells from a silhouette up to which uncovered white cells are tolerated: outlines of photographs have such errors.
const TOLERATED: f64 = 1.5;

/// The viewing cone of a mask.
pub(super) struct Cone<'a> {
    pub(super) view: &'a View,
    square: [f64; 3],
    /// Extent of the white area, in pixels.
    pub(super) white: f64,
    /// Signed distance to the outline in pixels of the picture, negative inside, at the cells of the square.
    distance: Vec<f64>,
    /// Whether the object is cut off by the picture border: the area beyond it is then unknown, else empty.
    pub(super) cut: bool,
}

impl<'a> Cone<'a> {
    pub(super) fn new(view: &'a View) -> anyhow::Result<Self> {
        let square = view.square()?;
        let [_, _, white] = view.mask.square().unwrap_or(square);
        let mask = view.mask.despeckled();
        let [levels, _] = mask.part(square, SIDE);
        let distance = signed_distance(&levels, square[2] / SIDE as f64);
        Ok(Self { view, square, white, distance, cut: !cut_sides(&view.mask).is_empty() })
    }

    /// The white cells of the square that are far from the silhouette of a mesh.
    pub(super) fn lacking(&self, mesh: &Mesh) -> Vec<bool> {
        let [left, top, extent] = self.square;
        let camera = self.view.camera.cropped([left, top], [extent; 2], SIDE);
        let [.., covered] = coloured_pixels(mesh, &camera);
        let covered: Vec<bool> = covered.iter().map(|&part| part >= 0.5).collect();
        let away = distances(&covered);
        let cell = extent / SIDE as f64;
        self.distance.iter().zip(away).map(|(&d, away)| d < -cell && away > TOLERATED).collect()
    }

    /// The cell of the square for a point.
    pub(super) fn cell(&self, p: [f64; 3]) -> Option<usize> {
        let [column, row, depth] = self.view.camera.pixel(p);
        let [left, top, extent] = self.square;
        let place = [column - left, row - top].map(|x| x * SIDE as f64 / extent);
        let is_in = depth > 0.0 && place.iter().all(|x| (0.0..SIDE as f64).contains(x));
        is_in.then(|| place[1] as usize * SIDE + place[0] as usize)
    }

    /// The line of sight through the middle of the mask, of length 1, in the world.
    pub(super) fn ray(&self) -> [f64; 3] {
        let ([left, top, extent], camera) = (self.square, &self.view.camera);
        let at = [left + extent / 2.0, top + extent / 2.0];
        let [x, y] = [0, 1].map(|k| (at[k] - camera.centre[k]) / camera.focal[k]);
        let length = (x * x + y * y + 1.0).sqrt();
        let r = camera.rotation;
        [0, 1, 2].map(|k| (x * r[0][k] + y * r[1][k] + r[2][k]) / length)
    }

    /// Approximate distance of a point to the cone in world units; negative inside, and beyond a picture that cuts the object off.
    pub(super) fn distance(&self, p: [f64; 3]) -> f64 {
        let camera = &self.view.camera;
        let [column, row, depth] = camera.pixel(p);
        if depth <= 0.0 {
            return f64::MAX;
        }
        let size = camera.size;
        let beyond = |x: f64, pixels: usize| x < 0.0 || x > pixels as f64;
        if self.cut && (beyond(column, size.width) || beyond(row, size.height)) {
            return f64::MIN;
        }
        let ([left, top, extent], last) = (self.square, (SIDE - 1) as f64);
        let cell = extent / SIDE as f64;
        let place = [(column - left) / cell - 0.5, (row - top) / cell - 0.5];
        let held = place.map(|x| x.clamp(0.0, last));
        let off = cell * (place[0] - held[0]).hypot(place[1] - held[1]);
        let low = held.map(|x| (x as usize).min(SIDE - 2));
        let [u, v] = [0, 1].map(|k| held[k] - low[k] as f64);
        let at = |dx: usize, dy: usize| self.distance[(low[1] + dy) * SIDE + low[0] + dx];
        let upper = (1.0 - u) * at(0, 0) + u * at(1, 0);
        let lower = (1.0 - u) * at(0, 1) + u * at(1, 1);
        let [fx, fy] = camera.focal;
        ((1.0 - v) * upper + v * lower + off) * depth * 2.0 / (fx + fy)
    }
}

/// Signed distance to the contour at one half of an image `[SIDE * SIDE]`, negative where levels are higher, for cells of width `cell`.
fn signed_distance(levels: &[f64], cell: f64) -> Vec<f64> {
    let white: Vec<bool> = levels.iter().map(|&level| level >= 0.5).collect();
    let black: Vec<bool> = white.iter().map(|white| !white).collect();
    let (to_white, to_black) = (distances(&white), distances(&black));
    let signed = |k: usize| {
        let level = levels[k];
        // In the cell of the outline, its level is more precise.
        if to_white[k].max(to_black[k]) < 1.5 && level > 0.0 && level < 1.0 {
            return cell * (0.5 - level);
        }
        cell * if white[k] { 0.5 - to_black[k] } else { to_white[k] - 0.5 }
    };
    (0..levels.len()).map(signed).collect()
}

/// Distance of each cell to the nearest cell that is on, in cells.
fn distances(on: &[bool]) -> Vec<f64> {
    const FAR: f64 = 1e9;
    // Along each column first, then the minimum over each row.
    let mut along = vec![FAR; on.len()];
    for x in 0..SIDE {
        for forward in [true, false] {
            let mut last = FAR;
            for k in 0..SIDE {
                let cell = if forward { k } else { SIDE - 1 - k } * SIDE + x;
                last = if on[cell] { 0.0 } else { last + 1.0 };
                along[cell] = along[cell].min(last);
            }
        }
    }
    let nearest = |k: usize| {
        let (row, x) = (&along[k / SIDE * SIDE..][..SIDE], k % SIDE);
        let mut least = row[x] * row[x];
        // From the near ones to the far ones, as long as one of them may be nearer.
        for off in 1..SIDE {
            let square = (off * off) as f64;
            if square >= least {
                break;
            }
            let left = x.checked_sub(off).map(|at| row[at]);
            for d in left.into_iter().chain(row.get(x + off).copied()) {
                least = least.min(square + d * d);
            }
        }
        least.sqrt()
    };
    (0..on.len()).map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_to_a_disc_is_that_of_a_circle() {
        let centre = 63.3;
        let far = |k: usize| ((k % SIDE) as f64 - centre).hypot((k / SIDE) as f64 - centre);
        // Cells on the circle are covered partially.
        let levels: Vec<f64> = (0..SIDE * SIDE).map(|k| (30.5 - far(k)).clamp(0.0, 1.0)).collect();
        for (k, found) in signed_distance(&levels, 2.0).into_iter().enumerate() {
            assert!((found - 2.0 * (far(k) - 30.0)).abs() < 1.2, "{k}: {found}");
        }
    }
}
