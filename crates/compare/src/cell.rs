use softrast_cli::{Common, Entry, MethodArgs, Variant};

use crate::tasks::AnyTask;

/// A task in one variant, solved with one method.
#[derive(Clone)]
pub struct Cell {
    /// The task.
    pub task: &'static AnyTask,
    /// Original or transfer.
    pub variant: Variant,
    /// The method.
    pub method: MethodArgs,
    /// Name of the method.
    pub name: String,
    /// Backend of this cell, if it differs from that of all cells.
    pub backend: Option<&'static str>,
    /// Seeds, from 0 on.
    pub runs: u32,
    /// Role of the cell.
    pub role: Role,
}

/// Tables and charts that show a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Role {
    /// All tables and charts except Table 6.
    Compared,
    /// A variation of another cell: a mark in the charts of error over seconds, but no curve.
    Varied(Variation),
    /// Table 6 only: the softness learned on the task of this name.
    Crossed(&'static str),
}

/// The property in which a method is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variation {
    /// Half the pixels a side.
    Resolution,
    /// A larger or smaller tolerance of a pixel.
    Tolerance,
    /// Another backend.
    Backend,
}

impl Cell {
    /// The experiment of the cell, on `backend` unless the cell has another.
    ///
    /// # Errors
    ///
    /// Any error of the task.
    pub fn entry(&self, backend: Option<&str>) -> anyhow::Result<Entry> {
        let backend = self.backend.or(backend).map(str::to_owned);
        let common = Common { variant: self.variant, backend, ..Common::default() };
        (self.task.entry)(&common, &self.method)
    }

    /// Seeds of the cell, from 0 on.
    pub fn seeds(&self) -> Vec<u64> {
        softrast_lab::seeds(0, self.runs as usize)
    }
}
