use std::path::Path;

use anyhow::{Context, ensure};
use image::{GrayImage, Luma};
use softrast_tensor::{Backend, Tensor, numbers};

/// Writes the views of an `image` `[views, height, width]` side by side to a gray PNG: 0 is black,
/// 1 is white; other values are clamped.
///
/// # Errors
///
/// If the file cannot be written, or the image is empty.
pub fn save_picture<B: Backend>(image: Tensor<B, 3>, path: impl AsRef<Path>) -> anyhow::Result<()> {
    let path = path.as_ref();
    let [views, height, width] = image.dims();
    ensure!(views * height * width > 0, "an empty image cannot be written to {}", path.display());
    let row = image.swap_dims(0, 1).reshape([height, views * width]);
    let levels = numbers(row);
    let picture = GrayImage::from_fn((views * width) as u32, height as u32, |x, y| {
        let level = levels[y as usize * views * width + x as usize];
        Luma([(level.clamp(0.0, 1.0) * 255.0).round() as u8])
    });
    picture.save(path).with_context(|| format!("cannot write the picture {}", path.display()))
}

#[cfg(test)]
mod tests {
    use softrast_tensor::NdArray;
    use softrast_views::Picture;

    use super::*;

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let levels = [0.0_f32, 1.0, 0.2, 0.4];
        let image = Tensor::<NdArray, 1>::from_floats(levels, &Default::default());
        save_picture(image.reshape([1, 2, 2]), &path).unwrap();
        let found = Picture::load_luminance(&path).unwrap().levels(2);
        assert!(
            found.iter().zip(levels).all(|(a, b)| (a - f64::from(b)).abs() < 1e-7),
            "{found:?}"
        );
    }
}
