//! POSE: finds the pose of a camera from a silhouette.
//!
//! The mesh is fixed; a camera orbits it. The camera starts up to 75 degrees from that of the
//! target picture, and Adam moves it by the gradient of a soft silhouette, until both silhouettes
//! agree.
//!
//! **Definition.** See [`softrast_inverse::pose`].
//!
//! **Field of view.** The released code starts it at a wrong random value and never moves it, which
//! leaves no pose that fits. Here instances know the field of view, as of a calibrated camera, or
//! optimise it with `--optimise-fov`. `--instances released24` uses the released values, right or
//! wrong, so that its numbers compare with the released curves.
//!
//! **Method.** The default is the softness learned here, a Gauss curve with an adaptive schedule: a run that stalls
//! restarts from another start around the given one, within the same steps. Without it about one run in twenty from 35 to 55 degrees
//! ends in a wrong pose that looks alike, such as front for back. If the image still does not fit, `solve` makes whole runs from other
//! starts and returns the best; `--starts 1` is one run, as in `evaluate`.
//!
//! **Colour.** With `--colour` the mesh has colours and the target is a picture in colours: [`colour`].
//!
//! **Transfer.** Fewer steps and a larger learning rate, on any mesh of `--mesh`.

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

/// The whole program: `--colour` selects another task, with another image and loss.
pub fn main() -> std::process::ExitCode {
    softrast_cli::main_of_two::<Pose, colour::Coloured>(|args| args.colour)
}
