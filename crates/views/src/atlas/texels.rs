//! Places and colours of texels.

use image::RgbImage;

/// Texels around a part of a picture.
const MARGIN: i64 = 1;

/// A box around texels: the first and the last.
pub(super) type Bounds = [[i64; 2]; 2];

/// A coordinate in texels of a picture, from its upper left corner.
pub(super) fn texels([u, v]: [f64; 2], picture: &RgbImage) -> [f64; 2] {
    [u * f64::from(picture.width()), (1.0 - v) * f64::from(picture.height())]
}

/// Corners moved by whole pictures, so that the lowest are in the first.
pub(super) fn shifted(corners: [[f64; 2]; 3], picture: &RgbImage) -> [[f64; 2]; 3] {
    let sides = [picture.width(), picture.height()].map(f64::from);
    let lowest =
        [0, 1].map(|k| corners.iter().map(|corner| corner[k]).fold(f64::INFINITY, f64::min));
    let back = [0, 1].map(|k| (lowest[k] / sides[k]).floor() * sides[k]);
    corners.map(|corner| [0, 1].map(|k| corner[k] - back[k]))
}

/// The texels needed by a triangle, including margins.
pub(super) fn bounds(corners: [[f64; 2]; 3]) -> Bounds {
    let of = |k: usize, pick: fn(f64, f64) -> f64, start: f64| {
        let all = corners.iter().map(|corner| corner[k]);
        (all.fold(start, pick) - 0.5).floor() as i64
    };
    [
        [0, 1].map(|k| of(k, f64::min, f64::INFINITY) - MARGIN),
        [0, 1].map(|k| of(k, f64::max, f64::NEG_INFINITY) + 1 + MARGIN),
    ]
}

pub(super) fn union([low, high]: [[i64; 2]; 2], other: [[i64; 2]; 2]) -> [[i64; 2]; 2] {
    [[0, 1].map(|k| low[k].min(other[0][k])), [0, 1].map(|k| high[k].max(other[1][k]))]
}

pub(super) fn size([low, high]: [[i64; 2]; 2]) -> [usize; 2] {
    [0, 1].map(|k| (high[k] - low[k] + 1) as usize)
}

pub(super) fn texels_in(bounds: [[i64; 2]; 2]) -> f64 {
    let [width, height] = size(bounds);
    width as f64 * height as f64
}

/// Corners in texels relative to `low`.
pub(super) fn from(corners: [[f64; 2]; 3], low: [i64; 2]) -> [[f64; 2]; 3] {
    corners.map(|corner| [0, 1].map(|k| corner[k] - low[k] as f64))
}

/// The levels of a texel of a repeating picture.
pub(super) fn repeated(picture: &RgbImage, x: i64, y: i64) -> [u8; 3] {
    let [x, y] = [(x, picture.width()), (y, picture.height())]
        .map(|(k, side)| k.rem_euclid(i64::from(side)) as u32);
    picture.get_pixel(x, y).0
}

/// The colour interpolated between the centres of the four texels around a position, from 0 to 1.
pub(super) fn between([x, y]: [f64; 2], picture: &RgbImage) -> [f64; 3] {
    let [x, y] = [x - 0.5, y - 0.5];
    let [left, above] = [x.floor(), y.floor()];
    let mix = |a: [f64; 3], b: [f64; 3], part: f64| [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
    let texel = |x: i64, y: i64| repeated(picture, x, y).map(|level| f64::from(level) / 255.0);
    let row = |y: i64| mix(texel(left as i64, y), texel(left as i64 + 1, y), x - left);
    mix(row(above as i64), row(above as i64 + 1), y - above)
}
