//! POSE: recovers the pose of a camera from a silhouette.
//!
//! The mesh stays as it is; what moves is a camera that orbits it. It starts up to 75 degrees from
//! where the target picture was taken, and Adam turns it, by the gradient of a soft silhouette,
//! until both silhouettes agree.
//!
//! **Definition.** See [`softrast_inverse::pose`].
//!
//! **Field of view.** The released code starts it at a wrong random value and never moves it, which
//! leaves no pose that fits. Here the camera's own instances know their field of view, as a
//! calibrated camera does, or optimise it with `--optimise-fov`. `--instances released24` keeps the
//! released values, right or wrong, so that its numbers compare with the released curves.
//!
//! **Method.** By default the softness that was learned here, a Gauss curve whose scale falls, with feedback: where the image tells that
//! a run is stuck, it begins again from another start around the given one, within the same steps. Without feedback about one run in
//! twenty from 35 to 55 degrees ends in a wrong pose that looks alike, such as front for back. Where the image still does not fit,
//! `solve` makes whole runs from other starts and keeps the one that fits best; `--starts 1` is one run, as `evaluate` has it.
//!
//! **Colour.** With `--colour` the mesh has colours and the target is a picture in colours: [`colour`].
//!
//! **Transfer.** Fewer steps and a larger learning rate, on whichever mesh `--mesh` names.

mod args;
pub mod colour;
mod error;
mod framing;
mod paper;
mod picture;
mod pictures;
mod released;
mod task;

pub use args::{Args, Instances, Range};
pub use error::PoseError;
pub use pictures::Pictures;
pub use released::released24;
pub use task::Pose;

/// The whole program: `--colour` makes another task of it, with another image and loss.
pub fn main() -> std::process::ExitCode {
    softrast_cli::main_of_two::<Pose, colour::Coloured>(|args| args.colour)
}
