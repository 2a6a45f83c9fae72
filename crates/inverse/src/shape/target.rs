use softrast_views::{PaintedView, Picture};

use super::view::ViewOfShape;

/// The square of a view at one resolution, row by row from the top.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) size: usize,
    /// Coverage of each pixel by the object.
    pub(super) mask: Vec<f32>,
    /// Coverage of each pixel by the picture.
    pub(super) counted: Vec<f32>,
    /// Half normals.
    pub(super) normals: Option<Channels>,
    pub(super) colours: Option<Channels>,
}

/// Three channels of a target.
#[derive(Clone, Debug)]
pub(super) struct Channels {
    /// Channels times the fraction of each pixel that counts.
    pub(super) levels: [Vec<f32>; 3],
    pub(super) part: Vec<f32>,
    /// Whether pixels count in full or not at all, except for averaging.
    pub(super) is_opaque: bool,
}

impl Target {
    /// The square of a view on `size` × `size` pixels.
    pub(super) fn new(view: &ViewOfShape, size: usize) -> Self {
        let part = |picture: &Picture| -> [Vec<f32>; 2] {
            picture.part(view.square, size).map(|levels| levels.iter().map(|&x| x as f32).collect())
        };
        let channels = |shown: &PaintedView, middle: f32| {
            let [counts, _] = part(&shown.part);
            let levels = shown.over_black().map(|channel| {
                let [mut levels, _] = part(&channel);
                levels
                    .iter_mut()
                    .zip(&counts)
                    .for_each(|(level, counts)| *level -= middle * counts);
                levels
            });
            Channels { levels, part: counts, is_opaque: shown.is_opaque() }
        };
        let [mask, counted] = part(&view.mask);
        let normals = view.normals.as_ref().map(|shown| channels(shown, 0.5));
        let colours = view.colours.as_ref().map(|shown| channels(shown, 0.0));
        Self { size, mask, counted, normals, colours }
    }

    /// The target on half as many pixels along each side.
    pub(super) fn halved(&self) -> Self {
        let half = |levels: &Vec<f32>| halved(levels, self.size);
        let channels = |of: &Channels| Channels {
            levels: of.levels.each_ref().map(half),
            part: half(&of.part),
            is_opaque: of.is_opaque,
        };
        Self {
            size: self.size / 2,
            mask: half(&self.mask),
            counted: half(&self.counted),
            normals: self.normals.as_ref().map(channels),
            colours: self.colours.as_ref().map(channels),
        }
    }
}

/// Means of two by two pixels.
fn halved(levels: &[f32], size: usize) -> Vec<f32> {
    let half = size / 2;
    let mean = |k: usize| {
        let corner = 2 * (k / half) * size + 2 * (k % half);
        let row = |start: usize| levels[start] + levels[start + 1];
        0.25 * (row(corner) + row(corner + size))
    };
    (0..half * half).map(mean).collect()
}
