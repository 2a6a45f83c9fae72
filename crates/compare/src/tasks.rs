use softrast_cli::{Common, Entry, MethodArgs, Paper, Task, usual_args};

/// All tasks, in the order of the tables.
pub static TASKS: &[AnyTask] = &[
    AnyTask::of::<shape2d::Shape2d>(),
    AnyTask::of::<shape3d::Shape3d>(),
    AnyTask::of::<pose::Pose>(),
    AnyTask::of::<occlusion::Occlusion>(),
];

/// A task of any type.
pub struct AnyTask {
    /// Name of its program.
    pub name: &'static str,
    /// Name in the paper.
    pub title: &'static str,
    /// Whether edges move. Only then can images be drawn on fewer pixels or less exactly, and only then is a surrogate useful.
    pub moves_edges: bool,
    /// The paper's data on the task.
    pub paper: &'static Paper,
    /// The task with the method given by flags, all else at its default. An error if flags contradict each other or a file cannot be used.
    pub entry: fn(&Common, &MethodArgs) -> anyhow::Result<Entry>,
}

impl AnyTask {
    const fn of<T: Task>() -> Self {
        Self {
            name: T::NAME,
            title: T::TITLE,
            moves_edges: T::MOVES_EDGES,
            paper: T::PAPER,
            entry: |common, method| T::entry(&usual_args(), common, method),
        }
    }
}

/// The task with this name.
///
/// # Errors
///
/// If no task has this name.
pub fn task(name: &str) -> anyhow::Result<&'static AnyTask> {
    let found = TASKS.iter().find(|task| task.name == name);
    found.ok_or_else(|| {
        let known: Vec<&str> = TASKS.iter().map(|task| task.name).collect();
        anyhow::anyhow!("there is no task {name:?}: expected {} or all", known.join(", "))
    })
}
