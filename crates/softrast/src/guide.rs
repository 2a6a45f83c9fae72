//! Fit a shape to masks, one step at a time, in Rust.
//!
//! The [examples] are complete programs, each below 40 lines. The snippets below run as shown.
//!
//! # An image and its gradient
//!
//! A camera [`project`]s vertices `[1, V, 3]` in world units to [`Projected`] ones `[views, V, 3]`, and a [`SoftRenderer`] draws these: coverage
//! `[views, H, W]` in [0, 1], top row first. Both are ordinary tensor ops, so gradients reach vertices, cameras and softness.
//!
//! ```
//! use softrast::{mesh::fox, prelude::*, tensor::{Autodiff, NdArray}};
//!
//! type B = Autodiff<NdArray>;
//! let (fox, device) = (fox(), Default::default()); // or Mesh::load("my.obj")?
//! let front = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 0.0, fov_deg: 60.0 };
//! let cameras = Orbit::tensors::<B>(&front.around(3), &device).require_grad(); // [3, 4]
//! let renderer = SoftRenderer::new(fox.faces(), [24, 32], Family::Gauss, Width::pixels(1.0));
//! let image = renderer.silhouette(project(vertex_tensor(fox.positions(), &device), cameras.clone()));
//! assert_eq!(image.dims(), [3, 24, 32]);
//! let by_cameras = cameras.grad(&image.mean().backward()).unwrap();
//! assert_eq!(by_cameras.dims(), [3, 4]);
//! ```
//!
//! [`Family`] is the softness, [`Width`] the blur of an edge: in pixels, or as a scale in NDC,
//! where the shorter side of an image is 2 long.
//!
//! # A fit
//!
//! A [`VertexModel`] is a mesh whose vertices are the parameter of a burn module, for burn's optimisers. [`Views`] reads masks
//! `[views, H, W]` and cameras of a folder; here both are generated. A width that narrows finds first the shape, then its edges.
//!
//! ```
//! # use softrast::{mesh::{fox, icosphere}, prelude::*, tensor::{Autodiff, NdArray, burn::optim::AdamConfig}};
//! # type B = Autodiff<NdArray>;
//! # let (fox, device) = (fox(), Default::default());
//! # let front = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 0.0, fov_deg: 60.0 };
//! let cameras = Orbit::tensors::<B>(&front.around(3), &device); // or views.cameras(&device)
//! let seen = project(vertex_tensor(fox.positions(), &device), cameras.clone());
//! let masks = hard_silhouette(seen, fox.faces(), [24, 32]); // or views.masks(&device)
//!
//! let mut shape = VertexModel::new(&icosphere(2), &device);
//! let width = Width::pixels(2.0).to(0.3);
//! let mut renderer = SoftRenderer::new(shape.faces(), [24, 32], Family::Gauss, width.at(0.0));
//! let mut adam = AdamConfig::new().init();
//! let mut losses: Vec<f32> = Vec::new();
//! for step in 0..40 {
//!     renderer.set_width(width.at(f64::from(step) / 39.0));
//!     let image = renderer.silhouette(project(shape.vertices(), cameras.clone()));
//!     let loss = iou_loss(image, masks.clone()).mean() + shape.laplacian() * 0.01;
//!     losses.push(loss.clone().into_scalar());
//!     shape = shape.step(&mut adam, 0.02, loss);
//! }
//! assert!(losses[39] < 0.5 * losses[0]);
//! let mesh: Mesh = shape.mesh()?; // mesh.save("fit.obj")?
//! # Ok::<(), softrast::mesh::MeshError>(())
//! ```
//!
//! The image is a tensor, so any other loss can replace [`iou_loss`]. [`Surface`] has further losses of the surface.
//!
//! # A softness of your own
//!
//! A [`Softness`] needs one method; renderers, schedules, files and learning accept it like those
//! of the crate. Slowly falling tails have a large reach: then every face is drawn at every pixel,
//! which takes many times longer. [`SoftRenderer::reach`] is the distance in NDC, and [`Truncated`]
//! the remedy.
//!
//! ```
//! use softrast::{prelude::*, tensor::NdArray};
//!
//! #[derive(Clone, Debug)]
//! struct Arctan;
//!
//! impl Softness for Arctan {
//!     fn value<B: Backend, const D: usize>(&self, phi: Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
//!         (x / phi.exp().reshape([1; D])).atan() / std::f64::consts::PI + 0.5
//!     }
//! }
//!
//! let width = Width::pixels(1.0);
//! let endless = SoftRenderer::new(&[[0, 1, 2]], 64, Arctan, width);
//! assert!(endless.reach::<NdArray>() > 2.0, "past all of the image");
//! let ended = SoftRenderer::new(&[[0, 1, 2]], 64, Truncated::new(Arctan, 3.0), width);
//! assert!(ended.reach::<NdArray>() < 0.1, "3 pixels");
//! ```
//!
//! # Colours, and second derivatives
//!
//! A [`ColourRenderer`] draws colours, textures and light, with gradients to all of them. On
//! `Autodiff<Autodiff<_>>` every gradient is differentiable in turn, as for a meta-gradient through
//! an optimisation: the example `meta_gradient` computes one by hand, and
//! [`learn`](fn@crate::inverse::learn) learns a softness with it.
//!
//! [examples]: https://github.com/softrast/softrast/tree/main/crates/softrast/examples
//! [`project`]: crate::raster::project
//! [`Projected`]: crate::raster::Projected
//! [`SoftRenderer`]: crate::raster::SoftRenderer
//! [`SoftRenderer::reach`]: crate::raster::SoftRenderer::reach
//! [`ColourRenderer`]: crate::raster::ColourRenderer
//! [`Width`]: crate::raster::Width
//! [`iou_loss`]: crate::raster::iou_loss
//! [`Family`]: crate::softness::Family
//! [`Softness`]: crate::softness::Softness
//! [`Truncated`]: crate::softness::Truncated
//! [`VertexModel`]: crate::inverse::VertexModel
//! [`Surface`]: crate::inverse::Surface
//! [`Views`]: crate::views::Views
