//! What all tasks share: a softness, how its scale moves over the steps, drawing with it, and the
//! steps themselves.
//!
//! A [`Method`] is what the command line names: a softness family or file with a path of scales, where
//! nobody says otherwise the one that [`Searched`] has for the task. A
//! [`MovingSilhouette`] draws with it, and prepares support and knots anew only when the scale has
//! moved so far that it must; how many pixels it draws may follow the scale, and [`Targets`] has the
//! target at each size. A [`Descent`] goes down the gradient of a task's loss and shows every
//! step.
//!
//! A task that implements [`Lesson`], or [`SilhouetteLesson`] if it sees silhouettes, can have a softness learned on it: `study` turns it into what the
//! command `learn` drives.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu")))]
compile_error!("softrast-method needs a backend: turn on one of the features ndarray, flex, wgpu");

mod backend;
#[cfg(feature = "ndarray")]
mod course;
#[cfg(not(feature = "ndarray"))]
mod course {
    //! Learning needs doubles and two levels of autodiff, which this backend does not have.

    /// Says that it cannot be done.
    ///
    /// # Errors
    ///
    /// Always.
    pub fn study(
        _lesson: impl crate::Lesson,
        _plan: &softrast_runner::Plan,
    ) -> anyhow::Result<Box<dyn softrast_runner::Study>> {
        anyhow::bail!("learn needs a program that was built with the feature ndarray")
    }
}
mod defaults;
mod descent;
mod fitted_mlp;
mod judge;
mod learned_edge;
mod learned_figures;
mod lesson;
mod method;
mod method_of_flags;
mod moving_silhouette;
mod prepared_run;
mod searched;
pub mod shipped;
mod silhouette_lesson;
mod targets;
mod tensor;

pub use course::study;
#[cfg(feature = "ndarray")]
pub use course::{Class, Inner, Outer, meta_gradient};
pub use defaults::Defaults;
pub use descent::{Descent, Moment};
pub use judge::Judge;
pub use learned_edge::LearnedEdge;
pub use lesson::{LEARNING_TOLERANCE, Lesson, finer};
pub use method::Method;
pub use moving_silhouette::MovingSilhouette;
pub use prepared_run::{Of, PreparedRun, Step};
pub use searched::Searched;
pub use silhouette_lesson::{LearnedSilhouette, SilhouetteLesson};
pub use targets::Targets;
pub use tensor::{numbers, on_host, read, tensor};
