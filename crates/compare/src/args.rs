use std::path::PathBuf;

use clap::Parser;
use softrast_raster::compiled_backends;
use softrast_runner::usual_tolerance;

use crate::{Cell, Purpose, TaskName};

/// Softness families whose settings are searched for, static and decaying, and the MLP. Its random start
/// reaches the whole image, which takes over twenty times as long as a logistic; the fitted one does not. A surrogate is
/// left out where no edge moves.
const METHODS: &str = "learned,learned-mlp,learned-surrogate,logistic --schedule static,gauss --schedule static,exp --schedule static,\
                       gamma --schedule static,mlp --init fitted --schedule static,\
                       logistic --schedule decay,\
                       gauss --schedule decay,exp --schedule decay,gamma --schedule decay";

/// What is varied unless said otherwise: the default of the tasks and the simplest method.
const VARIED: &str = "learned,logistic --schedule static";

/// Evaluates all methods on all tasks, original and transfer, and writes the tables.
///
/// After a kill the same command goes on from what is finished.
#[derive(Clone, Debug, Parser)]
#[command(version)]
pub struct Args {
    /// Tasks: shape2d, shape3d, pose, occlusion, or all.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', default_value = "all")]
    pub tasks: Vec<String>,

    /// Methods: softness families, softness files in JSON, or learned for what comes with the program;
    /// behind one may stand its schedule, or other flags of the tasks.
    #[arg(long, value_name = "NAME|FILE.json,...", value_delimiter = ',', default_value = METHODS)]
    pub methods: Vec<String>,

    /// Those of the methods, or others, that the charts of error against seconds also show with half the pixels a
    /// side, with pixels that may be off by more or less, neither of which OCCLUSION knows, and on every other backend
    /// that the program was built with; "" for none.
    #[arg(long, value_name = "NAME|FILE.json,...", value_delimiter = ',', default_value = VARIED)]
    pub varied: Vec<String>,

    /// What comes with the program for a task and is also tried on all other tasks that are compared, for Table 6; "" for
    /// none.
    #[arg(long, value_name = "learned|learned-mlp,...", value_delimiter = ',', default_value = "learned",
          value_parser = crossing)]
    pub crossed: Vec<String>,

    /// Seeds of every cell, instead of the number that its task asks for: one number, or one for each of
    /// the tasks in their order.
    #[arg(long, value_name = "N,...", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub runs: Vec<u32>,

    /// Few seeds, for a table in minutes instead of hours.
    #[arg(long, conflicts_with = "runs")]
    pub quick: bool,

    /// What to compute on: ndarray, flex or wgpu, if the program was built with it.
    #[arg(long, value_name = "NAME")]
    pub backend: Option<String>,

    /// Folder for the results of every cell.
    #[arg(long, value_name = "DIR", default_value = "out/compare")]
    pub out: PathBuf,

    /// File for the tables [default: results.md in the folder].
    #[arg(long, value_name = "FILE.md")]
    pub tables: Option<PathBuf>,

    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

impl Args {
    /// All cells in the order of the tables: by task, variant and method, and at the end what is tried on other tasks.
    ///
    /// # Errors
    ///
    /// If there is no task of that name, or the numbers of seeds are neither one nor one for each task.
    pub fn cells(&self) -> anyhow::Result<Vec<Cell>> {
        let mut tasks = Vec::new();
        for name in &self.tasks {
            match name.as_str() {
                "all" => tasks.extend(TaskName::ALL),
                name => tasks.push(name.parse()?),
            }
        }
        tasks.dedup();
        let others = self.other_backends();
        anyhow::ensure!(
            self.runs.len() <= 1 || self.runs.len() == tasks.len(),
            "--runs has {} numbers for {} tasks: say one, or one for each",
            self.runs.len(),
            tasks.len()
        );
        let runs = |(k, task): (usize, &TaskName)| {
            let usual = if self.quick { task.quick_runs() } else { task.runs() };
            (*task, self.runs.get(k).or(self.runs.first()).copied().unwrap_or(usual))
        };
        let tasks: Vec<(TaskName, u32)> = tasks.iter().enumerate().map(runs).collect();
        let compared = tasks.iter().flat_map(|&(task, runs)| {
            let backends = &others;
            VARIANTS.into_iter().flat_map(move |variant| {
                let cell =
                    move |purpose| move |method| Cell { task, variant, method, runs, purpose };
                let varied = self.varied.iter().filter(|method| !method.is_empty());
                let varied = varied.flat_map(move |method| {
                    let side = format!("{method} --resolution {}", task.size() / 2);
                    // What is usual where the scale moves, where it stays, and the other way round.
                    let stays = method.contains("--schedule static");
                    let other = usual_tolerance(stays);
                    let off = format!("{method} --tolerance {other:e}");
                    let freely = [side, off].into_iter().filter(move |_| task.moves_edges());
                    let on = |name: &&str| format!("{method} --backend {name}");
                    freely.chain(backends.iter().map(on).collect::<Vec<_>>())
                });
                let known =
                    move |method: &&String| task.moves_edges() || *method != "learned-surrogate";
                let methods = self.methods.iter().filter(known).cloned();
                methods.map(cell(Purpose::Compared)).chain(varied.map(cell(Purpose::Varied)))
            })
        });
        Ok(compared.chain(self.crossed(&tasks)).collect())
    }

    /// What was learned on each of the tasks on all others.
    fn crossed(&self, tasks: &[(TaskName, u32)]) -> impl Iterator<Item = Cell> {
        let names = self.crossed.iter().filter(|name| !name.is_empty() && tasks.len() > 1);
        names.flat_map(move |name| {
            let places = tasks.iter().flat_map(|to| VARIANTS.map(|variant| (*to, variant)));
            places.flat_map(move |((task, runs), variant)| {
                let methods = tasks.iter().map(move |(from, _)| from.learned_there(name, task));
                let new = methods.filter(|method| !self.methods.contains(method));
                let purpose = Purpose::Crossed;
                new.map(move |method| Cell { task, variant, method, runs, purpose })
            })
        })
    }

    /// Backends that the program was built with and the system has, beside the one that is computed on.
    fn other_backends(&self) -> Vec<&'static str> {
        let all = compiled_backends!();
        let first = all.first().map(|backend| backend.name());
        let used = self.backend.as_deref().or(first);
        let others = all.iter().filter(|backend| Some(backend.name()) != used);
        others.filter(|backend| backend.set_up().is_ok()).map(|backend| backend.name()).collect()
    }
}

const VARIANTS: [&str; 2] = ["original", "transfer"];

fn crossing(text: &str) -> Result<String, String> {
    match text {
        "" | "learned" | "learned-mlp" => Ok(text.to_owned()),
        _ => {
            Err("expected what comes with the program for every task: learned or learned-mlp"
                .into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(line: &str) -> Args {
        Args::parse_from(["compare"].into_iter().chain(line.split_whitespace()))
    }

    #[test]
    fn cells_go_through_tasks_variants_and_methods() {
        let cells = args("--quick").cells().unwrap();
        assert_eq!(cells.len(), 4 * 2 * 11 + 3 * 2 * (1 + 4) + 4 * 2 * 3);
        assert_eq!((cells[0].task, cells[18].variant), (TaskName::Shape2d, "transfer"));
        assert_eq!(cells[12].method, "learned --resolution 128");
        let of = |purpose| cells.iter().filter(move |cell| cell.purpose == purpose);
        assert_eq!(of(Purpose::Varied).count(), 3 * 2 * 4);
        let crossed: Vec<_> = of(Purpose::Crossed).map(|cell| cell.method.as_str()).collect();
        assert_eq!(crossed[..3], ["learned-shape3d", "learned-pose", "learned-occlusion"]);
        assert_eq!(crossed[21..], ["learned-shape2d", "learned-shape3d", "learned-pose"]);
        let some =
            args("--tasks pose --methods gauss,a/b.json --varied exp --runs 7").cells().unwrap();
        assert!(some.len() == 8 && some[3].runs == 7 && some[5].method_name() == "b");
        assert_eq!(some[2].method_name(), "exp resolution 32");
        let runs = |line| {
            let cells = args(line).cells().unwrap();
            TaskName::ALL.map(|task| cells.iter().find(|cell| cell.task == task).unwrap().runs)
        };
        assert_eq!(args("--tasks pose --methods exp --varied=").cells().unwrap().len(), 2);
        let two = "--tasks pose,occlusion --methods exp --varied= --crossed learned-mlp";
        assert_eq!(args(two).cells().unwrap()[4].method, "learned-mlp");
        assert_eq!(args(two).cells().unwrap()[5].method, "learned-occlusion-mlp");
        assert_eq!(args(two).cells().unwrap().len(), 2 * 2 + 2 * 2 * 2);
        assert_eq!(runs("--runs 3"), [3; 4]);
        assert_eq!(runs("--runs 20,5,60,50"), [20, 5, 60, 50]);
        assert!(args("--runs 20,5").cells().is_err());
        let line = ["compare", "--crossed", "learned-surrogate"];
        assert!(Args::try_parse_from(line).unwrap_err().to_string().contains("every task"));
        assert!(args("--tasks teapot").cells().unwrap_err().to_string().contains("shape2d"));
    }
}
