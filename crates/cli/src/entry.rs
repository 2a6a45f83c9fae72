use serde_json::{Map, Value};
use softrast_inverse::{Method, SolveConfig};
use softrast_lab::Experiment;

/// A task with a method, ready to be evaluated, independent of the task's type.
pub struct Entry {
    /// The experiment to run.
    pub experiment: Box<dyn Experiment>,
    /// The method.
    pub method: Method,
    /// Size, steps and learning rate.
    pub solve: SolveConfig,
    /// All settings that determine the numbers.
    pub settings: Map<String, Value>,
    /// Faces of the scene.
    pub faces: usize,
}
