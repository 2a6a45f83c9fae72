//! Code shared by the studies: tasks with a method, and the page that a study writes.

use std::{fs, path::Path, rc::Rc};

use anyhow::Context;
use clap::Parser;
use softrast_cli::{Common, MethodArgs, Purpose, Schedule, SoftnessChoice, Task, TaskExperiment};
use softrast_inverse::{Method, SolveConfig};
use softrast_lab::{Inputs, OutputFolder, write_atomically};
use softrast_softness::Family;

/// Name of the study, equal to that of the example.
const NAME: &str = env!("CARGO_CRATE_NAME");

/// The flags of a study.
#[derive(Parser)]
pub(crate) struct Study {
    /// Run a small version in under a minute and write to out/ instead of docs/studies/
    #[arg(long)]
    pub(crate) quick: bool,
}

impl Study {
    /// Writes a file to the documents, or to `out` in the quick mode.
    pub(crate) fn file(&self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        if self.quick {
            let study = format!("study {NAME}");
            let mut folder = OutputFolder::open(Path::new("out"), &study, &Inputs::default())?;
            folder.stage(name, bytes)?;
            return Ok(folder.commit_beside(|_| true)?);
        }
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies").join(name);
        write_atomically(&path, bytes).with_context(|| path.display().to_string())
    }

    /// Writes `text` between the study's two marks in a page of the documents; in the quick mode, as a separate page.
    pub(crate) fn page(&self, page: &str, text: &str) -> anyhow::Result<()> {
        if self.quick {
            return self.file(&format!("{NAME}.md"), text.as_bytes());
        }
        let start = format!("<!-- what follows is written by the study {NAME} -->\n");
        let end = format!("<!-- end of what the study {NAME} writes -->");
        let old = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies").join(page);
        let old = fs::read_to_string(old)?;
        let (before, rest) =
            old.split_once(&start).context("the page has no mark for the start")?;
        let (_, after) = rest.split_once(&end).context("the page has no mark for the end")?;
        self.file(page, format!("{before}{start}{text}{end}{after}").as_bytes())
    }
}

/// A family with fixed width.
pub(crate) fn constant(family: Family) -> MethodArgs {
    MethodArgs {
        softness: Some(SoftnessChoice::Family(family)),
        schedule: Some(Schedule::Static),
        ..MethodArgs::default()
    }
}

/// A task, its method and its settings.
pub(crate) fn setup<T: Task>(
    args: &T::Args,
    common: &Common,
    method: &MethodArgs,
) -> anyhow::Result<(T, Method, SolveConfig)> {
    let experiment = TaskExperiment::<T>::new(args, common, method, Purpose::Learning)?;
    let task = Rc::into_inner(experiment.task).context("a task has one owner")?;
    Ok((task, experiment.method, experiment.solve))
}
