use std::path::Path;

use anyhow::{Context, ensure};
use image::{GrayImage, Luma, Rgb, RgbImage};
use softrast_tensor::{Backend, Tensor, numbers};

/// Writes the views of an `image` `[views, height, width]` side by side to a gray PNG: 0 is black,
/// 1 is white; other values are clamped.
///
/// # Errors
///
/// If the file cannot be written, or the image is empty.
pub fn save_picture<B: Backend>(image: Tensor<B, 3>, path: impl AsRef<Path>) -> anyhow::Result<()> {
    let path = path.as_ref();
    let (width, [levels]) = side_by_side(image.unsqueeze_dim::<4>(1), path)?;
    let height = levels.len() / width;
    let picture = GrayImage::from_fn(width as u32, height as u32, |x, y| {
        Luma([levels[y as usize * width + x as usize]])
    });
    picture.save(path).with_context(|| format!("cannot write the picture {}", path.display()))
}

/// Writes the views of an `image` `[views, channels, height, width]`, as [`ColourRenderer::image`](softrast_raster::ColourRenderer::image) draws them, side by side
/// to a PNG: the first three channels are red, green and blue from 0 to 1; other values are clamped.
///
/// # Errors
///
/// If the file cannot be written, the image is empty, or it has fewer than three channels.
pub fn save_colour_picture<B: Backend>(
    image: Tensor<B, 4>,
    path: impl AsRef<Path>,
) -> anyhow::Result<()> {
    let path = path.as_ref();
    ensure!(image.dims()[1] >= 3, "colours have three channels, the image has {}", image.dims()[1]);
    let (width, [red, green, blue]) = side_by_side(image, path)?;
    let height = red.len() / width;
    let picture = RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let pixel = y as usize * width + x as usize;
        Rgb([red[pixel], green[pixel], blue[pixel]])
    });
    picture.save(path).with_context(|| format!("cannot write the picture {}", path.display()))
}

/// The width of all views side by side, and the levels of the first N channels, row by row.
fn side_by_side<B: Backend, const N: usize>(
    image: Tensor<B, 4>,
    path: &Path,
) -> anyhow::Result<(usize, [Vec<u8>; N])> {
    let [views, channels, height, width] = image.dims();
    ensure!(
        views * channels * height * width > 0,
        "an empty image cannot be written to {}",
        path.display()
    );
    let level = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    let channel = |k: usize| {
        let rows = image.clone().narrow(1, k, 1).permute([2, 1, 0, 3]);
        numbers(rows.reshape([height * views * width])).into_iter().map(level).collect()
    };
    Ok((views * width, std::array::from_fn(channel)))
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
    #[test]
    fn views_in_colour_stand_side_by_side() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        // Two views of one column and two rows, and four channels of which the last is not shown.
        let levels = (0..16).map(|k| f64::from(k) / 15.0).collect();
        let image = softrast_tensor::tensor::<NdArray, 4>(levels, [2, 4, 2, 1]);
        save_colour_picture(image, &path).unwrap();
        let found = image::open(&path).unwrap().to_rgb8();
        assert_eq!((found.width(), found.height()), (2, 2));
        let numbers: Vec<u8> = found.into_raw().iter().map(|byte| byte / 17).collect();
        assert_eq!(numbers, [0, 2, 4, 8, 10, 12, 1, 3, 5, 9, 11, 13]);
        let gray = Tensor::<NdArray, 4>::zeros([1, 2, 2, 2], &Default::default());
        assert!(save_colour_picture(gray, &path).unwrap_err().to_string().contains("has 2"));
    }
}
