use std::path::Path;

use softrast_cli::Variant;
use softrast_raster::ImageSize;
use softrast_views::Picture;

use crate::Logo;

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
    /// If the file is missing or no picture.
    pub(crate) fn load(path: &Path) -> anyhow::Result<Self> {
        let source = Source::Picture(Picture::load_luminance(path)?);
        Ok(Self { name: path.display().to_string(), source })
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
