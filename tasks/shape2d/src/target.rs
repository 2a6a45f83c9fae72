use std::path::Path;

use anyhow::ensure;
use softrast_cli::Variant;
use softrast_raster::ImageSize;
use softrast_views::Picture;

use crate::Logo;

/// Largest ratio of the sides of a picture: images of thinner ones would not fit into memory.
const MOST_LONG: usize = 16;

/// Refuses a picture that is more than [`MOST_LONG`] times as long as wide.
pub(crate) fn ensure_not_thin(picture: &Picture, path: &Path) -> anyhow::Result<()> {
    let size = picture.size();
    let longer = size.height.max(size.width);
    ensure!(
        longer <= MOST_LONG * size.shorter(),
        "{}: a picture of {size} pixels is too thin: crop it until one side is at most {MOST_LONG} times the other",
        path.display()
    );
    Ok(())
}

/// A picture to cover, at any size.
pub(crate) struct Target {
    name: String,
    source: Source,
}

enum Source {
    Logo(Logo),
    Picture(Picture),
}

impl Target {
    /// The project's own logo of a variant.
    pub(crate) fn logo(variant: Variant) -> Self {
        let name = match variant {
            Variant::Original => "letters",
            Variant::Transfer => "skyline",
        };
        Self { name: name.to_owned(), source: Source::Logo(Logo::of(variant)) }
    }

    /// The luminance of a picture file; transparent pixels are black.
    ///
    /// # Errors
    ///
    /// If the file is missing, no picture, or too thin.
    pub(crate) fn load(path: &Path) -> anyhow::Result<Self> {
        let picture = Picture::load_luminance(path)?;
        ensure_not_thin(&picture, path)?;
        Ok(Self { name: path.display().to_string(), source: Source::Picture(picture) })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The size of an image whose shorter side has `size` pixels: with the proportions of a picture, or square.
    pub(crate) fn image_size(&self, size: usize) -> ImageSize {
        match &self.source {
            Source::Logo(_) => size.into(),
            Source::Picture(picture) => picture.size_at(size),
        }
    }

    /// The image whose shorter side has `size` pixels, `[height * width]`, top row first, 0 black to 1 white.
    ///
    /// Each pixel is the mean of a picture over its area.
    pub(crate) fn image(&self, size: usize) -> Vec<f64> {
        match &self.source {
            Source::Logo(logo) => logo.image(size),
            Source::Picture(picture) => picture.resized(picture.size_at(size)),
        }
    }
}
