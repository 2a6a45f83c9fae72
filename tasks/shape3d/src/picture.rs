//! What a run looks like.

use image::RgbImage;
use softrast_runner::{Pictures, contact_sheet, difference, rgb_from_gray};

use crate::scene::VIEWS;

/// Views that are shown: from ahead, from a corner, from the side and from behind.
const SHOWN: [usize; 4] = [0, VIEWS / 8, VIEWS / 4, VIEWS / 2];
/// Views in a row.
const COLUMNS: usize = 2;

/// Collects the pictures of a scene while it is solved.
pub(crate) struct Album {
    target: RgbImage,
    start: Option<RgbImage>,
    result: RgbImage,
    frames: Vec<RgbImage>,
    size: usize,
    /// Least hard loss so far.
    least: f64,
}

impl Album {
    /// An empty album of an instance whose hard target is `target` `[views * size * size]`.
    pub(crate) fn new(target: &[f64], size: usize) -> Self {
        let target = sheet(target, size);
        let result = target.clone();
        let (frames, least) = (Vec::new(), f64::INFINITY);
        Self { start: None, result, target, frames, size, least }
    }

    /// Takes the soft silhouettes `image` `[views * size * size]` after a step, as the result if
    /// no step before had a lower loss `hard` of the hard ones, and as a frame of the animation if so
    /// asked.
    pub(crate) fn take(&mut self, image: &[f64], hard: f64, frame: bool) {
        let now = sheet(image, self.size);
        self.start.get_or_insert_with(|| now.clone());
        if frame {
            self.frames.push(now.clone());
        }
        if hard <= self.least {
            (self.result, self.least) = (now, hard);
        }
    }

    /// The pictures; each silhouette is white on black.
    pub(crate) fn pictures(self) -> Pictures {
        let Self { target, start, result, frames, .. } = self;
        let difference = difference(&target, &result);
        Pictures {
            start: start.unwrap_or_else(|| result.clone()),
            target,
            result,
            difference,
            frames,
        }
    }
}

/// Some of the views on one sheet.
fn sheet(image: &[f64], size: usize) -> RgbImage {
    let view = |view: usize| &image[view * size * size..(view + 1) * size * size];
    contact_sheet(&SHOWN.map(|shown| rgb_from_gray(view(shown), size, size)), COLUMNS)
}
