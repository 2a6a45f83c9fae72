//! Pictures, masks and cameras in files, and computations on them without gradients.
//!
//! A [`Picture`] is a mask or a channel of a picture file, read with [`MaskRules`]. A [`CameraFile`] holds the cameras of many pictures, in
//! the formats of nerfstudio, COLMAP or OpenCV; a [`Lens`] and a [`PoseFile`] are the two halves of one camera. [`load_views`] reads
//! pictures with their cameras, each a [`View`]; [`Views`] are tensors of them. [`visual_hull`] computes a solid from their masks,
//! [`coloured_pixels`] renders a mesh.
//!
//! ```
//! use softrast_mesh::icosphere;
//! use softrast_raster::Pinhole;
//! use softrast_views::{Picture, coloured_pixels, mask_iou};
//!
//! let camera = Pinhole::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 64);
//! let [.., covered] = coloured_pixels(&icosphere(2), &camera);
//! let mask = Picture::new(covered.iter().map(|&part| part as f32).collect(), 64);
//! assert_eq!(mask_iou(&covered, &mask), 1.0);
//! ```
//!
//! # Example: colours of a picture
//!
//! A [`PaintedView`] adds the colours of its picture to a view; [`TexelReads`] compares them with a texture on an [`Unwrapped`] mesh.
//!
//! ```
//! use softrast_mesh::icosphere;
//! use softrast_raster::Pinhole;
//! use softrast_views::{PaintedView, Picture, TexelPull, TexelReads, Unwrapped, View, coloured_pixels};
//!
//! let (ball, distortion) = (icosphere(2), None);
//! let camera = Pinhole::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 32);
//! let picture = |levels: Vec<f64>| Picture::new(levels.iter().map(|&x| x as f32).collect(), 32);
//! let [red, green, blue, mask] = coloured_pixels(&ball, &camera).map(picture);
//! let view = View { name: "white".into(), picture: "white.png".into(), mask, camera, distortion, off: 0.0 };
//! let opaque = Picture::new(vec![1.0; 32 * 32], 32);
//! let view = PaintedView::new(view, [red, green, blue], &opaque);
//! assert!(view.psnr(&ball).unwrap() > 60.0);
//!
//! let unwrapped = Unwrapped::of(&ball, 64)?;
//! let reads = TexelReads::new(&ball, &unwrapped, &[view], 0.0)?;
//! let [black, white] = [0.0, 1.0].map(|level| reads.pull(&[level; 3 * 64 * 64], true));
//! let TexelPull { half, gradient } = black;
//! assert!(white.half < 1e-6 * half && gradient.iter().all(|&by_texel| by_texel <= 0.0));
//! # anyhow::Ok(())
//! ```

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu", feature = "cuda")))]
compile_error!(
    "softrast-views needs a backend: turn on one of the features ndarray, flex, wgpu, cuda"
);

mod atlas;
mod cameras;
mod coloured_pixels;
mod cut_sides;
mod frame;
mod hull;
mod levels;
mod mask_parts;
mod mask_rules;
mod painted_view;
mod picture;
mod picture_file;
mod texel_reads;
mod unwrapped;
mod view;
mod views;

pub use atlas::{Atlas, painted_by_texture};
pub use cameras::{CameraFile, Distortion, Lens, PoseFile, colmap_pose, find_mask, load_views};
pub use coloured_pixels::{coloured_pixels, nearest_samples, textured_pixels};
pub use cut_sides::cut_sides;
pub use frame::{Frame, bounding_ball};
pub use hull::{VisualHull, frame_of_masks, visual_hull};
pub use mask_parts::mask_parts;
pub use mask_rules::MaskRules;
pub use painted_view::PaintedView;
pub use picture::Picture;
pub use picture_file::PictureFile;
pub use texel_reads::{TexelPull, TexelReads};
pub use unwrapped::{Unwrapped, covered_texels};
pub use view::{View, camera_json, faces_across, faces_across_note, mask_iou, reading_notes};
pub use views::Views;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
