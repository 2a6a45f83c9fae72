//! Views of a folder as tensors.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};

use softrast_raster::{ImageSize, Pinhole};
use softrast_tensor::NdArray;
use softrast_views::{Picture, View, Views};

fn fox() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox")
}

#[test]
fn masks_cameras_and_pictures_of_a_folder_belong_together() {
    let (views, device) = (Views::load(fox()).unwrap(), Default::default());
    let ImageSize { height, width } = views.size();
    let masks = views.masks::<NdArray>(&device);
    assert_eq!(masks.dims(), [views.len(), height, width]);
    let pictures = views.pictures::<NdArray>(&device).unwrap();
    assert_eq!(pictures.dims(), [views.len(), 3, height, width]);
    let cameras = views.cameras::<NdArray>(&device);
    assert_eq!((cameras.rotation.dims()[0], cameras.size), (views.len(), views.size()));
    let levels: Vec<f32> = masks.into_data().to_vec().unwrap();
    assert_eq!(levels[..height * width], *views[0].mask.pixels());
    assert_eq!(levels[(views.len() - 1) * height * width..], *views[views.len() - 1].mask.pixels());
}

/// A view of `side` × `side` pixels.
fn square(name: &str, side: usize) -> View {
    View {
        name: name.to_owned(),
        picture: name.into(),
        mask: Picture::new(vec![1.0; side * side], side),
        camera: Pinhole::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, side),
        distortion: None,
        off: 0.0,
    }
}

#[test]
fn views_of_two_sizes_and_none_are_errors_of_one_line() {
    let found = Views::new(vec![square("one.png", 4), square("two.png", 5)]).unwrap_err();
    let line = found.to_string();
    assert!(
        line.starts_with("views of one size are needed, but one.png is 4 x 4 and two.png is 5 x 5"),
        "{line}"
    );
    assert!(!line.contains('\n'));
    assert_eq!(Views::new(Vec::new()).unwrap_err().to_string(), "there are no views");
    // The error names a missing picture.
    let missing = Views::new(vec![square("gone.png", 4)]).unwrap();
    let line = missing.pictures::<NdArray>(&Default::default()).unwrap_err().to_string();
    assert!(line.contains("gone.png"), "{line}");
}
