use image::RgbImage;
use softrast_runner::{Pictures, difference, rgb_from_planes};

/// Collects the pictures of one view while it is solved.
pub(crate) struct Album {
    target: RgbImage,
    start: RgbImage,
    result: RgbImage,
    frames: Vec<RgbImage>,
    size: usize,
}

impl Album {
    /// An empty album of an instance whose target is `target` `[3 * size * size]`.
    pub(crate) fn new(target: &[f64], size: usize) -> Self {
        let target = rgb_from_planes(target, size, size);
        let [start, result] = [(); 2].map(|()| target.clone());
        Self { target, start, result, frames: Vec::new(), size }
    }

    /// Takes the soft image `image` `[3 * size * size]` after `step`, the latest as the result, and
    /// also as a frame of the animation if so asked.
    pub(crate) fn take(&mut self, image: &[f64], step: usize, frame: bool) {
        self.result = rgb_from_planes(image, self.size, self.size);
        if step == 0 {
            self.start = self.result.clone();
        }
        if frame {
            self.frames.push(self.result.clone());
        }
    }

    /// The pictures.
    pub(crate) fn pictures(self) -> Pictures {
        let Self { target, start, result, frames, .. } = self;
        let difference = difference(&target, &result);
        Pictures { target, start, result, difference, frames }
    }
}
