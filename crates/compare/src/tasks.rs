use std::marker::PhantomData;

use softrast_cli::{Common, Entry, MethodArgs, Paper, Task};

/// The tasks that are compared, in the order of the tables.
macro_rules! tasks {
    ($($task:ty),* $(,)?) => {
        /// All tasks.
        pub static TASKS: &[&dyn AnyTask] = &[$(&Of::<$task>(PhantomData)),*];
    };
}

tasks! {
    shape2d::Shape2d,
    shape3d::Shape3d,
    pose::Pose,
    occlusion::Occlusion,
}

/// A task of any type.
pub trait AnyTask: Sync {
    /// Name of its program.
    fn name(&self) -> &'static str;

    /// Name in the paper.
    fn title(&self) -> &'static str;

    /// Whether edges move. Only then can images be drawn on fewer pixels or less exactly, and only then is a surrogate useful.
    fn moves_edges(&self) -> bool;

    /// The paper's data on the task.
    fn paper(&self) -> &'static Paper;

    /// The task with the method given by flags, all else at its default.
    ///
    /// # Errors
    ///
    /// If flags contradict each other or a file cannot be used.
    fn entry(&self, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry>;
}

struct Of<T>(PhantomData<fn() -> T>);

impl<T: Task> AnyTask for Of<T> {
    fn name(&self) -> &'static str {
        T::NAME
    }

    fn title(&self) -> &'static str {
        T::TITLE
    }

    fn moves_edges(&self) -> bool {
        T::MOVES_EDGES
    }

    fn paper(&self) -> &'static Paper {
        T::paper()
    }

    fn entry(&self, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        T::entry(&softrast_cli::usual_args(), common, method)
    }
}

/// The task with this name.
///
/// # Errors
///
/// If no task has this name.
pub fn task(name: &str) -> anyhow::Result<&'static dyn AnyTask> {
    let found = TASKS.iter().copied().find(|task| task.name() == name);
    found.ok_or_else(|| {
        let known: Vec<&str> = TASKS.iter().map(|task| task.name()).collect();
        anyhow::anyhow!("there is no task {name:?}: expected {} or all", known.join(", "))
    })
}
