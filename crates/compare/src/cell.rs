use softrast_cli::{Common, Entry, MethodArgs, SoftnessChoice, Variant};

use crate::tasks::AnyTask;

/// A task in one variant, solved with one method.
#[derive(Clone)]
pub struct Cell {
    /// The task.
    pub task: &'static dyn AnyTask,
    /// Original or transfer.
    pub variant: Variant,
    /// The method.
    pub method: MethodArgs,
    /// What the method is called.
    pub name: String,
    /// Another backend than the one of all cells.
    pub backend: Option<&'static str>,
    /// Seeds, from 0 on.
    pub runs: u32,
    /// What it is for.
    pub purpose: Purpose,
}

/// Where a cell is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// In all tables and charts but Table 6.
    Compared,
    /// As one that only varies another: a mark on the charts of error against seconds, but no curve.
    Varied(Variation),
    /// In Table 6 alone: what was learned on the task of this name.
    Crossed(&'static str),
}

/// What a method is varied in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variation {
    /// Half the pixels a side.
    Resolution,
    /// A larger or smaller error of a pixel.
    Tolerance,
    /// Another backend.
    Backend,
}

impl Cell {
    /// What is run, on the `backend` that all cells are computed on.
    ///
    /// # Errors
    ///
    /// Those of the task.
    pub fn entry(&self, backend: Option<&str>) -> anyhow::Result<Entry> {
        let backend = self.backend.or(backend).map(str::to_owned);
        let common = Common { variant: self.variant, backend, ..Common::default() };
        self.task.entry(&common, &self.method)
    }

    /// Its seeds.
    pub fn seeds(&self) -> Vec<u64> {
        softrast_lab::seeds(0, self.runs as usize)
    }

    /// Whether it is what the task's program does without flags.
    pub fn is_default(&self) -> bool {
        self.method
            == MethodArgs { softness: Some(SoftnessChoice::Preset), ..MethodArgs::default() }
            && self.purpose == Purpose::Compared
    }
}
