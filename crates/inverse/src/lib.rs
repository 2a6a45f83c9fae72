//! Inverse rendering under a soft rasterizer: solving problems, and learning the softness on them.
//!
//! An [`InverseProblem`] defines the parameters, the image and the loss. A [`Method`] defines how edges are softened over a run: its
//! [`ScheduledSoftness`] has the parameters of a softness and the schedule of its scale, and can be stored in a file. [`minimize`] solves
//! instances of a problem with a method and passes on every step; [`learn()`] improves a method by the gradient of the final error of whole
//! runs. Both draw through a [`ScheduledRenderer`], on top of a `SoftRenderer` of `softrast-raster`, which decides when support and knots
//! are chosen anew. [`PoseProblem`] finds a camera.
//!
//! The softness is a type parameter, by default an `EdgeSoftness` of a family. Any other `Softness` works as well, and a [`NamedSoftness`]
//! can be stored in files.
//!
//! ```
//! use softrast_tensor::NdArray;
//! use softrast_inverse::{InverseProblem, Iterate, Method, PoseProblem, ScheduledSoftness, SolveConfig, minimize};
//! use softrast_mesh::icosphere;
//!
//! let problem = PoseProblem::new(&icosphere(0));
//! let method = Method::new("learned", ScheduledSoftness::learned("pose")?);
//! let config = SolveConfig { size: 8, steps: 2, ..problem.defaults() };
//! let mut steps = Vec::new();
//! minimize::<_, NdArray>(&problem, &[problem.instance(0)?], &method, &config, |iterate: &Iterate, _| {
//!     steps.push(iterate.step);
//!     Ok(())
//! })?;
//! assert_eq!(steps, [0, 1, 2]);
//! # Ok::<(), anyhow::Error>(())
//! ```
//!
//! # Example: colours
//!
//! [`paint`] finds the colours of the vertices of a mesh, [`paint_texture`] its texture; [`PaintTargets`] are views as targets of a loss
//! of one's own.
//!
//! ```
//! use softrast_inverse::{FoundTexture, PaintTargets, SolveConfig, paint, paint_texture};
//! use softrast_mesh::icosphere;
//! # use softrast_raster::Pinhole;
//! use softrast_raster::HostBackend;
//! use softrast_tensor::{numbers, tensor};
//! # use softrast_views::{PaintedView, Picture, View, coloured_pixels};
//! # let ball = icosphere(2);
//! # let views = [[0.0, 0.0, 4.0], [0.0, 0.0, -4.0]].map(|eye| {
//! #     let camera = Pinhole::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], 40.0, 32);
//! #     let [.., covered] = coloured_pixels(&ball, &camera);
//! #     let mask = Picture::new(covered.iter().map(|&x| x as f32).collect(), 32);
//! #     let [red, none] = [1.0, 0.0].map(|level| Picture::new(vec![level; 32 * 32], 32));
//! #     let view = View { name: "red".into(), picture: "".into(), mask, camera, distortion: None, off: 0.0 };
//! #     PaintedView::new(view, [red.clone(), none.clone(), none], &red)
//! # });
//!
//! // Two views of a red ball, from in front and from behind.
//! let config = SolveConfig { size: 16, steps: 5, learning_rate: 0.1 };
//! let painted = paint(&ball, &views, &config, |_, _| Ok(()))?;
//! assert!(painted.colours().unwrap().iter().all(|[red, green, _]| *red > 0.9 && *green < 0.1));
//! let FoundTexture { mesh, stopped, .. } = paint_texture(&ball, &painted, &views, Some(64), |_, _| Ok(()))?;
//! assert!(mesh.texture().is_some() && stopped.is_none());
//!
//! let whole = views.iter().map(|view| (view, [0.0, 0.0, 32.0]));
//! let targets = PaintTargets::<HostBackend>::new(whole, 8);
//! // Red, green, blue and the share of the faces.
//! let image = |pixel: [f64; 4]| tensor::<HostBackend, 4>(pixel.to_vec(), [1, 4, 1, 1]).expand([2, 4, 8, 8]);
//! let [red, green] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]].map(|pixel| numbers(targets.loss(image(pixel)))[0]);
//! assert!(red < 1e-9 && green > 0.1);
//! # Ok::<(), anyhow::Error>(())
//! ```

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu", feature = "cuda")))]
compile_error!(
    "softrast-inverse needs a backend: turn on one of the features ndarray, flex, wgpu, cuda"
);

mod baked;
mod checkpoint;
mod cuts;
mod distilled_mlp;
mod instances;
mod iterate;
mod layout;
mod learn;
mod learn_config;
mod method;
mod minimize;
mod objectives;
mod paint;
mod paint_targets;
pub mod pose;
mod problem;
mod remeshing_adam;
mod renderer;
mod resolution;
mod save_picture;
mod schedule;
pub mod shape;
mod silhouette_pixels;
mod softness_file;
mod surface;
mod targets;
mod texture;
pub mod triangles;
mod vertex_model;

pub use baked::baked;
pub use checkpoint::Checkpoint;
pub use distilled_mlp::{distilled_mlp, mlp_like};
pub use instances::Instances;
pub use iterate::Iterate;
pub use layout::PhiLayout;
pub use learn::{Learning, learn};
pub use learn_config::{Input, LearnConfig, OuterLoss, SIGMA};
pub use method::Method;
pub use minimize::{Minimization, minimize};
pub use objectives::{Inner, Outer};
pub use paint::{paint, paint_until_stopped};
pub use paint_targets::PaintTargets;
pub use pose::PoseProblem;
pub use problem::{InverseProblem, SolveConfig};
pub use remeshing_adam::RemeshingAdam;
pub use renderer::{ScheduledRenderer, SoftnessAt};
pub use resolution::Resolution;
pub use save_picture::{save_colour_picture, save_picture};
pub use schedule::{
    AdaptiveSchedule, AdaptiveStep, Controller, ScaleSchedule, ScheduledSoftness, Surrogate,
};
pub use silhouette_pixels::silhouette_pixels;
pub use softness_file::{DepthSoftnessFile, NameOrFile, NamedSoftness, SoftnessFileError};
pub use surface::Surface;
pub use targets::Targets;
pub use texture::{FoundTexture, paint_texture};
pub use vertex_model::VertexModel;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
