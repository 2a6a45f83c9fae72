/// A number that every point of a run has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metric {
    /// Key in the results, such as `image_error.hard`, which is nested in `image_error`.
    pub key: &'static str,
    /// Name on a chart axis, such as `camera angle`.
    pub name: &'static str,
    /// Unit, such as `degrees`; empty for a pure number.
    pub unit: &'static str,
    /// Role of the metric.
    pub role: Role,
}

/// Role of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The loss that the optimiser minimises.
    Loss,
    /// The error that methods are compared by, and that determines the returned step of a run. It
    /// must not need the true answer. There is exactly one.
    Score,
    /// Another error: lower is better.
    Error,
    /// Another measure: higher is better.
    Gain,
    /// Recorded in addition to the errors.
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

/// Index of the metric with this role.
///
/// # Panics
///
/// If there is none.
pub fn place(metrics: &[Metric], role: Role) -> usize {
    let found = metrics.iter().position(|metric| metric.role == role);
    found.unwrap_or_else(|| panic!("no metric is a {role:?}"))
}
