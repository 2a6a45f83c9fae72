use std::{ops::Deref, path::Path};

use anyhow::ensure;
use softrast_raster::{ImageSize, Pinholes};
use softrast_tensor::{Backend, Tensor, tensor_on};

use crate::{Picture, View, load_views};

/// Views of one object whose masks have one size, as tensors for a custom loop.
///
/// ```no_run
/// use softrast_tensor::NdArray;
/// use softrast_views::Views;
///
/// # fn main() -> anyhow::Result<()> {
/// let (views, device) = (Views::load("data/views/fox")?, Default::default());
/// let masks = views.masks::<NdArray>(&device); // [20, 90, 120]
/// let cameras = views.cameras::<NdArray>(&device);
/// let pictures = views.pictures::<NdArray>(&device)?; // [20, 3, 90, 120]
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Views(Vec<View>);

impl Views {
    /// The views of a folder, found as by [`load_views`], with masks by the default [`MaskRules`](crate::MaskRules).
    ///
    /// # Errors
    ///
    /// See [`load_views`] and [`Views::new`].
    pub fn load(folder: impl AsRef<Path>) -> anyhow::Result<Self> {
        Self::new(load_views(folder, |path| Picture::load_mask(path))?)
    }

    /// Creates views, after checks.
    ///
    /// # Errors
    ///
    /// If there is none, masks differ in size, or a mask does not have the size of its camera's image: one line with their names.
    pub fn new(views: Vec<View>) -> anyhow::Result<Self> {
        ensure!(!views.is_empty(), "there are no views");
        let first = &views[0];
        for view in &views {
            let (size, other) = (view.camera.size, first.camera.size);
            let mask = view.mask.size();
            ensure!(
                mask == size,
                "{}: the mask is {mask}, the picture of its camera {size}",
                view.name
            );
            ensure!(
                size == other,
                "views of one size are needed, but {} is {other} and {} is {size} (width x height): scale or crop the pictures, or draw each view by \
                 itself",
                first.name,
                view.name
            );
        }
        Ok(Self(views))
    }

    /// Height and width of all masks, in pixels.
    pub fn size(&self) -> ImageSize {
        self[0].camera.size
    }

    /// The masks in [0, 1], `[views, height, width]`, top row first.
    pub fn masks<B: Backend>(&self, device: &B::Device) -> Tensor<B, 3> {
        let ImageSize { height, width } = self.size();
        let levels = self.iter().flat_map(|view| view.mask.pixels());
        tensor_on(
            levels.map(|&level| f64::from(level)).collect(),
            [self.len(), height, width],
            device,
        )
    }

    /// The cameras, for [`project`](softrast_raster::project).
    pub fn cameras<B: Backend>(&self, device: &B::Device) -> Pinholes<B> {
        let cameras: Vec<_> = self.iter().map(|view| view.camera).collect();
        Pinholes::new(&cameras, device)
    }

    /// The pictures, undistorted: red, green and blue in [0, 1], `[views, 3, height, width]`, top row first.
    ///
    /// # Errors
    ///
    /// If a picture cannot be read, or does not have the size of its mask: one line with its name.
    pub fn pictures<B: Backend>(&self, device: &B::Device) -> anyhow::Result<Tensor<B, 4>> {
        let size = self.size();
        let mut levels = Vec::with_capacity(3 * self.len() * size.pixels());
        for view in self.iter() {
            for channel in Picture::load_colours(&view.picture)? {
                let channel = view.undistorted(channel);
                let found = channel.size();
                ensure!(
                    found == size,
                    "{}: the picture is {found}, its mask {size}",
                    view.picture.display()
                );
                levels.extend(channel.pixels().iter().map(|&level| f64::from(level)));
            }
        }
        Ok(tensor_on(levels, [self.len(), 3, size.height, size.width], device))
    }
}

impl Deref for Views {
    type Target = [View];

    fn deref(&self) -> &[View] {
        &self.0
    }
}
