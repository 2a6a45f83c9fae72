use softrast_cli::{Common, MethodArgs, SoftnessChoice, Variant};
use softrast_lab::Runner;

use crate::{Measured, tasks::AnyTask};

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
    /// Whether it is what the task's program does without flags.
    pub fn is_default(&self) -> bool {
        self.method
            == MethodArgs { softness: Some(SoftnessChoice::Learned(None)), ..MethodArgs::default() }
            && self.purpose == Purpose::Compared
    }

    /// Whether the softness comes with the programs.
    pub fn is_learned(&self) -> bool {
        matches!(self.method.softness, Some(SoftnessChoice::Learned(_)))
    }

    /// Evaluates the cell on the `backend` that all cells are computed on; what is finished is not done again.
    ///
    /// # Errors
    ///
    /// Those of the task.
    pub fn evaluate(&self, runner: &mut Runner, backend: Option<&str>) -> anyhow::Result<Measured> {
        let common = Common {
            variant: self.variant,
            backend: self.backend.or(backend).map(str::to_owned),
            ..Common::default()
        };
        let entry = self.task.entry(&common, &self.method)?;
        let seeds = softrast_lab::seeds(0, self.runs as usize);
        runner.progress.expect(entry.solve.steps * seeds.len());
        let (mut evaluations, stopped) =
            runner.evaluate(&[entry.experiment.as_ref()], &seeds, true, Some(&self.name))?;
        if stopped {
            return Err(softrast_lab::Error::Interrupted.into());
        }
        Measured::new(self.clone(), entry, evaluations.remove(0))
    }
}
