//! The appearance of a group of faces.

use std::sync::Arc;

use crate::MeshError;

/// The colours of faces: a picture if there is one, else the colours of the vertices, times a factor.
///
/// The picture is stored as the content of its file, PNG or JPEG. It is not decoded here, so it may be corrupt.
///
/// ```
/// use softrast_mesh::{Material, Texture};
///
/// let red = Material::default().with_factor([1.0, 0.0, 0.0])?;
/// let corners = vec![[0, 1, 2], [2, 1, 3]];
/// let texture = Texture::new(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], corners)?
///     .with_materials(vec![Material::default(), red], vec![0, 1])?;
/// let of_second = texture.of_faces()[1] as usize;
/// assert_eq!(texture.materials()[of_second].factor(), [1.0, 0.0, 0.0]);
/// assert!(Material::default().with_picture(*b"GIF89a").is_err());
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    picture: Option<Arc<[u8]>>,
    factor: [f64; 3],
}

impl Default for Material {
    /// White: no picture, a factor of 1.
    fn default() -> Self {
        Self { picture: None, factor: [1.0; 3] }
    }
}

impl Material {
    /// Sets the picture: the content of a PNG or JPEG file.
    ///
    /// # Errors
    ///
    /// If its first bytes are those of neither format.
    pub fn with_picture(self, picture: impl Into<Arc<[u8]>>) -> Result<Self, MeshError> {
        let picture = picture.into();
        if media_type(&picture).is_none() {
            return Err(MeshError::Picture);
        }
        Ok(Self { picture: Some(picture), ..self })
    }

    /// Sets a factor for red, green and blue, linear in light, like `baseColorFactor` in glTF.
    ///
    /// # Errors
    ///
    /// If a factor is not from 0 to 1.
    pub fn with_factor(self, factor: [f64; 3]) -> Result<Self, MeshError> {
        match factor.iter().all(|x| (0.0..=1.0).contains(x)) {
            true => Ok(Self { factor, ..self }),
            false => Err(MeshError::Factor),
        }
    }

    /// A material of valid parts.
    pub(crate) fn of(picture: Option<Arc<[u8]>>, factor: [f64; 3]) -> Self {
        Self { picture, factor }
    }

    /// The content of a PNG or JPEG file.
    pub fn picture(&self) -> Option<&[u8]> {
        self.picture.as_deref()
    }

    /// The factor for red, green and blue, linear in light, from 0 to 1.
    pub fn factor(&self) -> [f64; 3] {
        self.factor
    }
}

/// The media type of a PNG or JPEG file, determined by its first bytes.
pub(crate) fn media_type(picture: &[u8]) -> Option<&'static str> {
    if picture.starts_with(b"\x89PNG\r\n\x1a\n") {
        return Some("image/png");
    }
    picture.starts_with(b"\xff\xd8\xff").then_some("image/jpeg")
}

/// Converts a channel of a picture, from 0 to 1, to linear light.
///
/// Source: IEC 61966-2-1 (sRGB).
pub fn to_linear(x: f64) -> f64 {
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// Converts a channel of linear light to sRGB; both from 0 to 1. The inverse of [`to_linear`].
///
/// ```
/// use softrast_mesh::{from_linear, to_linear};
///
/// let half = from_linear(0.5);
/// assert!((half - 0.735).abs() < 1e-3);
/// assert!((to_linear(half) - 0.5).abs() < 1e-9);
/// ```
///
/// Source: IEC 61966-2-1 (sRGB).
pub fn from_linear(x: f64) -> f64 {
    let root = x.powf(1.0 / 2.4);
    // In this form 1 is exactly 1.
    if x <= 0.003_130_8 { 12.92 * x } else { root + 0.055 * (root - 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_from_0_to_1() {
        for wrong in [-0.1, 1.1, f64::NAN] {
            let error = Material::default().with_factor([1.0, wrong, 0.0]).unwrap_err();
            assert_eq!(error.to_string(), "a factor of a material is not from 0 to 1");
        }
    }

    #[test]
    fn light_and_levels_are_inverse() {
        for level in 0..=255 {
            let x = f64::from(level) / 255.0;
            assert!((from_linear(to_linear(x)) - x).abs() < 1e-7, "level {level}");
        }
        assert_eq!((to_linear(1.0), from_linear(1.0), to_linear(0.0)), (1.0, 1.0, 0.0));
    }
}
