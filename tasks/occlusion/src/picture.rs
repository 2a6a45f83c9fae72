use image::RgbImage;
use softrast_runner::{Pictures, difference, rgb_from_planes};

/// Collects the pictures of one view while it is solved.
pub(crate) struct Album {
    target: RgbImage,
    start: RgbImage,
    result: RgbImage,
    frames: Vec<RgbImage>,
    size: usize,
    /// Least hard loss so far.
    least: f64,
}

impl Album {
    /// An empty album of an instance whose target is `target` `[3 * size * size]`.
    pub(crate) fn new(target: &[f64], size: usize) -> Self {
        let target = rgb_from_planes(target, size, size);
        let [start, result] = [(); 2].map(|()| target.clone());
        Self { target, start, result, frames: Vec::new(), size, least: f64::INFINITY }
    }

    /// Takes the soft image `image` `[3 * size * size]` after `step`, as the result if no step before
    /// had a lower loss `hard` of the hard one, and as a frame of the animation if so asked.
    pub(crate) fn take(&mut self, image: &[f64], step: usize, hard: f64, frame: bool) {
        let now = rgb_from_planes(image, self.size, self.size);
        if step == 0 {
            self.start = now.clone();
        }
        if frame {
            self.frames.push(now.clone());
        }
        if hard <= self.least {
            (self.result, self.least) = (now, hard);
        }
    }

    /// The pictures.
    pub(crate) fn pictures(self) -> Pictures {
        let Self { target, start, result, frames, .. } = self;
        let difference = difference(&target, &result);
        Pictures { target, start, result, difference, frames }
    }
}
