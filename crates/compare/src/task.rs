use std::str::FromStr;

/// One of the four tasks of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskName {
    /// 2D SHAPE.
    Shape2d,
    /// 3D SHAPE.
    Shape3d,
    /// POSE.
    Pose,
    /// OCCLUSION.
    Occlusion,
}

impl TaskName {
    /// All of them, in the order of the paper.
    pub const ALL: [Self; 4] = [Self::Shape2d, Self::Shape3d, Self::Pose, Self::Occlusion];

    /// Name of the program.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shape2d => "shape2d",
            Self::Shape3d => "shape3d",
            Self::Pose => "pose",
            Self::Occlusion => "occlusion",
        }
    }

    /// Name in the paper.
    pub fn title(self) -> &'static str {
        match self {
            Self::Shape2d => "2D SHAPE",
            Self::Shape3d => "3D SHAPE",
            Self::Pose => "POSE",
            Self::Occlusion => "OCCLUSION",
        }
    }

    /// What `learned` or `learned-KIND` of this task is called on another, or on itself.
    pub(crate) fn learned_there(self, name: &str, task: Self) -> String {
        match name.strip_prefix("learned") {
            Some(kind) if task != self => format!("learned-{}{kind}", self.name()),
            _ => name.to_owned(),
        }
    }

    /// Width and height of its images, in pixels.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Shape2d => 256,
            Self::Shape3d | Self::Pose | Self::Occlusion => 64,
        }
    }

    /// Whether edges move: only then can its images be drawn on fewer pixels and less exactly, and a surrogate be felt.
    pub(crate) fn moves_edges(self) -> bool {
        self != Self::Occlusion
    }

    /// Seeds of a full comparison.
    ///
    /// Source: FACTS 4.3 and 4.4 (200 pairs of POSE, 20 runs of 2D SHAPE) and 4.2 (five elevations);
    /// the paper does not tell it of OCCLUSION.
    pub(crate) fn runs(self) -> u32 {
        match self {
            Self::Shape2d => 20,
            Self::Shape3d => 5,
            Self::Pose => 200,
            Self::Occlusion => 50,
        }
    }

    /// Seeds of a quick one.
    pub(crate) fn quick_runs(self) -> u32 {
        match self {
            Self::Shape2d | Self::Shape3d => 1,
            Self::Pose | Self::Occlusion => 5,
        }
    }
}

impl FromStr for TaskName {
    type Err = anyhow::Error;

    fn from_str(name: &str) -> anyhow::Result<Self> {
        let known = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|task| task.name() == name);
        found.ok_or_else(|| {
            anyhow::anyhow!("there is no task {name:?}: expected {} or all", known())
        })
    }
}
