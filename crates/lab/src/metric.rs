/// A number that every point of a run has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metric {
    /// Its place in the results, such as `image_error.hard`, which stands inside `image_error`.
    pub key: &'static str,
    /// Name as it stands on a chart axis, such as `camera angle`.
    pub name: &'static str,
    /// Unit, such as `degrees`; empty for a pure number.
    pub unit: &'static str,
    /// What it counts for.
    pub role: Role,
}

/// What a metric counts for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// What the optimiser lowers.
    Loss,
    /// The error that methods are compared by, and that decides which step of a run is returned. It must be one that can be seen
    /// without the answer. There is exactly one.
    Score,
    /// Another error: lower is better.
    Error,
    /// Another measure: higher is better.
    Gain,
    /// Recorded beside the errors.
    Trace,
}

impl Metric {
    /// Name with the unit, such as `camera angle (degrees)`.
    pub fn title(&self) -> String {
        match self.unit {
            "" => self.name.to_owned(),
            unit => format!("{} ({unit})", self.name),
        }
    }

    /// Name of its column in a table, such as `image_error_hard`.
    pub fn column(&self) -> String {
        self.key.replace('.', "_")
    }

    /// Whether runs are judged by it.
    pub fn is_measure(&self) -> bool {
        matches!(self.role, Role::Score | Role::Error | Role::Gain)
    }

    /// Whether higher is better.
    pub fn is_gain(&self) -> bool {
        self.role == Role::Gain
    }
}

/// Place of the metric with this role.
///
/// # Panics
///
/// If there is none.
pub fn place(metrics: &[Metric], role: Role) -> usize {
    let found = metrics.iter().position(|metric| metric.role == role);
    found.unwrap_or_else(|| panic!("no metric is a {role:?}"))
}
