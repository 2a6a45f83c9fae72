use serde_json::{Map, Value};
use softrast_inverse::{Method, SolveConfig};
use softrast_lab::Experiment;

/// A task with a method, ready to be evaluated, whichever task it is.
pub struct Entry {
    /// The command that is run.
    pub experiment: Box<dyn Experiment>,
    /// The method.
    pub method: Method,
    /// Size, steps and learning rate.
    pub solve: SolveConfig,
    /// Every choice behind the numbers.
    pub settings: Map<String, Value>,
    /// Faces of the scene.
    pub faces: usize,
}
