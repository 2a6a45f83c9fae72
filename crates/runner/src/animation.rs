use image::{
    Delay, DynamicImage, Frame, RgbImage,
    codecs::gif::{GifEncoder, Repeat},
};

use crate::{picture::labelled_row, task::FRAMES};

/// Small pictures are enlarged to at least this width, in pixels.
const WIDTH: u32 = 192;
const FRAME_MS: u32 = 80;
const LAST_FRAME_MS: u32 = 2000;

/// Quality of the palette, 1 best to 30 fastest. Up to 256 colours are kept exactly in any case.
const SPEED: i32 = 10;

/// An endless GIF: the target on the left, the frames on the right, at most 80 of them.
pub(crate) fn gif(target: &RgbImage, frames: &[RgbImage]) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = GifEncoder::new_with_speed(&mut bytes, SPEED);
    encoder.set_repeat(Repeat::Infinite)?;
    for k in shown(frames.len()) {
        let row = labelled_row(&[("target", target), ("result", &frames[k])], WIDTH);
        let ms = if k + 1 == frames.len() { LAST_FRAME_MS } else { FRAME_MS };
        let delay = Delay::from_numer_denom_ms(ms, 1);
        let rgba = DynamicImage::from(row).into_rgba8();
        encoder.encode_frame(Frame::from_parts(rgba, 0, 0, delay))?;
    }
    drop(encoder);
    Ok(bytes)
}

/// Which of `count` frames to show: all, or evenly spaced ones with the first and the last.
fn shown(count: usize) -> Vec<usize> {
    if count <= FRAMES {
        return (0..count).collect();
    }
    (0..FRAMES).map(|k| k * (count - 1) / (FRAMES - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Batch;

    #[test]
    fn long_runs_are_thinned_to_the_limit() {
        let frames = shown(301);
        assert_eq!((frames.len(), frames[0], frames[FRAMES - 1]), (FRAMES, 0, 300));
        assert_eq!(shown(3), [0, 1, 2]);
    }

    #[test]
    fn a_batch_asks_for_as_many_frames_as_are_shown() {
        let batch = Batch { seeds: vec![0], pictures: true };
        for steps in [1, 2, 79, 80, 300, 1001] {
            let wanted: Vec<_> = (0..=steps).filter(|&k| batch.wants_frame(k, steps)).collect();
            assert_eq!(wanted.len(), (steps + 1).min(FRAMES), "{steps} steps");
            assert_eq!((wanted[0], wanted[wanted.len() - 1]), (0, steps));
        }
        let batch = Batch { pictures: false, ..batch };
        assert!((0..9).all(|k| !batch.wants_frame(k, 9)));
    }
}
