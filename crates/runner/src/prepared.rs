use std::fs;

use serde_json::{Value, json};

use crate::{Description, Settings, SoftnessChoice, Task};

/// A task that is ready to run, and what it was made from.
pub(crate) struct Prepared<T> {
    pub(crate) task: T,
    pub(crate) settings: Settings,
    pub(crate) description: Description,
}

impl<T: Task> Prepared<T> {
    /// Prepares the task.
    ///
    /// # Errors
    ///
    /// Those of [`Task::prepare`].
    pub(crate) fn new(settings: Settings, args: &T::Args) -> anyhow::Result<Self> {
        let task = T::prepare(&settings, args)?;
        let description = task.describe();
        Ok(Self { task, settings, description })
    }

    /// Instances solved together.
    pub(crate) fn batch_size(&self) -> usize {
        self.task.batch_size().max(1)
    }

    /// Seeds that the user asks for, or the task if he does not say.
    pub(crate) fn seeds(&self) -> Vec<u64> {
        let runs = self.settings.runs.unwrap_or(self.description.runs);
        seeds(self.settings.seed, runs)
    }

    /// All that decides the numbers, so that a journal is taken up by the same job only.
    pub(crate) fn identity(&self) -> Value {
        let Description { softness, backend, steps, size, faces, settings, .. } = &self.description;
        // A file can change under its name. One that cannot be read is the task's to refuse.
        let file = match &self.settings.softness {
            Some(SoftnessChoice::File(path)) => fs::read_to_string(path).ok(),
            _ => None,
        };
        json!({
            "variant": self.settings.variant.name(),
            "softness": softness,
            "softness_file": file,
            "backend": backend,
            "steps": steps,
            "size": size,
            "faces": faces,
            "batch": self.batch_size(),
            "settings": settings,
        })
    }
}

/// `runs` seeds from the first on.
pub(crate) fn seeds(first: u64, runs: usize) -> Vec<u64> {
    (0..runs as u64).map(|k| first.wrapping_add(k)).collect()
}
