use std::path::PathBuf;

use clap::Parser;
use softrast_cli::{
    MethodArgs, SoftnessChoice, Variant, is_preset, is_preset_learned, learned_kind,
};
use softrast_inverse::{Method, Resolution, ScheduledSoftness};
use softrast_lab::Shard;
use softrast_raster::compiled_backends;

use crate::{
    Cell, Role, Variation,
    tasks::{AnyTask, TASKS, task},
};

/// Default methods: bundled softnesses, families with searched settings at fixed and decaying width, and the fitted MLP. A random MLP
/// reaches the whole image and takes over twenty times as long as a logistic.
const METHODS: &str = "preset,learned,searched,learned-mlp,learned-surrogate,logistic --schedule static,gauss --schedule static,exp --schedule static,\
                       gamma --schedule static,mlp --init fitted --schedule static,logistic --schedule decay,gauss --schedule decay,\
                       exp --schedule decay,gamma --schedule decay";

/// Methods varied by default: the default of the tasks and the simplest method.
const VARIED: &str = "preset,logistic --schedule static";

/// Evaluates all methods on all tasks, original and transfer, and writes the tables.
///
/// After an interruption the same command resumes from the finished runs.
#[derive(Clone, Debug, Parser)]
#[command(version)]
pub struct Args {
    /// Tasks by name, or all
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', default_value = "all")]
    pub tasks: Vec<String>,

    /// Methods: softness families or files, preset, or learned for the softness learned on the task; each may be followed by its own flags
    #[arg(long, value_name = "NAME|FILE.json,...", value_delimiter = ',', default_value = METHODS, value_parser = named)]
    pub methods: Vec<NamedMethod>,

    /// Methods that are also compared at half the resolution, with another pixel tolerance, and on every other backend that the program was
    /// built with; "" for none
    #[arg(long, value_name = "NAME|FILE.json,...", value_delimiter = ',', default_value = VARIED, value_parser = named)]
    pub varied: Vec<NamedMethod>,

    /// Bundled softnesses of a task that are also evaluated on all other tasks, for Table 6; "" for none
    #[arg(long, value_name = "learned|learned-mlp,...", value_delimiter = ',', default_value = "learned", value_parser = crossing)]
    pub crossed: Vec<String>,

    /// Seeds per cell: one number, or one per task in their order [default: the task's number]
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub runs: Vec<u32>,

    /// Few seeds, for a table in minutes instead of hours
    #[arg(long, conflicts_with = "runs")]
    pub quick: bool,

    /// Backend to compute on: ndarray, flex, wgpu or cuda, if the program was built with it
    #[arg(long, value_name = "NAME")]
    pub backend: Option<String>,

    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/compare")]
    pub out: PathBuf,

    /// File for the tables [default: results.md in the folder]
    #[arg(long, value_name = "FILE.md")]
    pub tables: Option<PathBuf>,

    /// Only rebuild the tables of these documents, and the charts beside them, from their stored records; an error if a table differed
    #[arg(long, value_name = "FILE.md,...", value_delimiter = ',', conflicts_with = "tables")]
    pub recompute: Vec<PathBuf>,

    /// Make only every N-th run, from the I-th on, as one of N processes that share the folder; auto takes both numbers from Slurm or
    /// mpirun
    #[arg(long, value_name = "I/N|auto", value_parser = Shard::parse, conflicts_with = "recompute")]
    pub shard: Option<Shard>,

    /// Print one JSON object instead of the summary
    #[arg(long)]
    pub json: bool,

    /// Show no progress
    #[arg(long)]
    pub quiet: bool,
}

/// A method with its name; no method for the empty text.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedMethod {
    name: String,
    method: Option<MethodArgs>,
}

fn named(text: &str) -> Result<NamedMethod, String> {
    if text.is_empty() {
        return Ok(NamedMethod { name: String::new(), method: None });
    }
    let method = MethodArgs::parse(text)?;
    let softness = match &method.softness {
        Some(SoftnessChoice::File(path)) => {
            path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
        }
        choice => choice.as_ref().map(ToString::to_string).unwrap_or_default(),
    };
    // The flags without `--`, and without `--schedule`.
    let flags = text.split_whitespace().skip(1).filter(|word| *word != "--schedule");
    let words = flags.map(|word| word.trim_start_matches("--").to_owned());
    let name = [softness].into_iter().chain(words).collect::<Vec<_>>().join(" ");
    Ok(NamedMethod { name, method: Some(method) })
}

fn crossing(text: &str) -> Result<String, String> {
    match text {
        "" | "learned" | "learned-mlp" => Ok(text.to_owned()),
        _ => {
            Err("expected a softness that is bundled for every task: learned or learned-mlp".into())
        }
    }
}

/// Whether the bundled softness of a method exists for a task; a new task may have none.
fn is_there(task: &'static AnyTask, method: &MethodArgs) -> bool {
    let there = |name: &str| ScheduledSoftness::learned(name).is_ok();
    match &method.softness {
        Some(SoftnessChoice::Searched) => ScheduledSoftness::searched(task.name).is_ok(),
        Some(SoftnessChoice::Preset) => ScheduledSoftness::preset(task.name).is_ok(),
        Some(SoftnessChoice::Learned(None)) => there(task.name),
        Some(SoftnessChoice::Learned(Some(kind))) => there(&learned_kind(task.name, kind)),
        _ => true,
    }
}

impl Args {
    /// All cells in the order of the tables: by task, variant and method, then the methods crossed between tasks.
    ///
    /// # Errors
    ///
    /// If a task does not exist, or the numbers of seeds are neither one nor one per task.
    pub fn cells(&self) -> anyhow::Result<Vec<Cell>> {
        let mut tasks: Vec<&'static AnyTask> = Vec::new();
        for name in &self.tasks {
            match name.as_str() {
                "all" => tasks.extend(TASKS),
                name => tasks.push(task(name)?),
            }
        }
        tasks.dedup_by_key(|task| task.name);
        anyhow::ensure!(
            self.runs.len() <= 1 || self.runs.len() == tasks.len(),
            "--runs has {} numbers for {} tasks: say one, or one for each",
            self.runs.len(),
            tasks.len()
        );
        let backends = self.other_backends();
        let mut cells = Vec::new();
        for (k, task) in tasks.iter().enumerate() {
            for variant in Variant::ALL {
                let runs = self.runs_of(k, task);
                self.compared(task, variant, runs, &backends, &mut cells)?;
            }
        }
        for kind in self.crossed.iter().filter(|kind| !kind.is_empty() && tasks.len() > 1) {
            for (k, task) in tasks.iter().enumerate() {
                for variant in Variant::ALL {
                    let runs = self.runs_of(k, task);
                    let crossed =
                        tasks.iter().map(|from| self.crossed_cell(task, variant, runs, from, kind));
                    cells
                        .extend(crossed.collect::<anyhow::Result<Vec<_>>>()?.into_iter().flatten());
                }
            }
        }
        Ok(cells)
    }

    /// Adds the cells of the methods as given, and varied.
    ///
    /// A learned or searched softness is omitted if it is the preset and the preset is compared.
    fn compared(
        &self,
        task: &'static AnyTask,
        variant: Variant,
        runs: u32,
        backends: &[&'static str],
        cells: &mut Vec<Cell>,
    ) -> anyhow::Result<()> {
        let cell = |name: String, method: MethodArgs, backend, role| Cell {
            task,
            variant,
            method,
            name,
            backend,
            runs,
            role,
        };
        let is = |method: &MethodArgs, choice| {
            *method == MethodArgs { softness: Some(choice), ..MethodArgs::default() }
        };
        let mut methods = self.methods.iter().filter_map(|one| one.method.as_ref());
        let has_preset = methods.any(|method| is(method, SoftnessChoice::Preset));
        for NamedMethod { name, method } in &self.methods {
            let Some(method) = method.as_ref().filter(|method| is_there(task, method)) else {
                continue;
            };
            let name_of_task = task.name;
            let shown_twice = match is(method, SoftnessChoice::Searched) {
                true => is_preset(name_of_task, ScheduledSoftness::searched(name_of_task)),
                false => {
                    is(method, SoftnessChoice::Learned(None)) && is_preset_learned(name_of_task)
                }
            };
            if has_preset && shown_twice {
                continue;
            }
            cells.push(cell(name.clone(), method.clone(), None, Role::Compared));
        }
        for NamedMethod { name, method } in &self.varied {
            let Some(method) = method.as_ref().filter(|method| is_there(task, method)) else {
                continue;
            };
            let varied = |what: String| format!("{name} {what}");
            if task.moves_edges {
                let usual =
                    (task.entry)(&softrast_cli::Common { variant, ..Default::default() }, method)?;
                let side = usual.solve.size / 2;
                let fewer =
                    MethodArgs { resolution: Some(Resolution::Side(side)), ..method.clone() };
                let role = Role::Varied(Variation::Resolution);
                cells.push(cell(varied(format!("resolution {side}")), fewer, None, role));
                // The usual tolerance of a moving width where this one is fixed, and vice versa.
                let other = Method::usual_tolerance(usual.method.softness.is_constant());
                let less = MethodArgs { tolerance: Some(other), ..method.clone() };
                let role = Role::Varied(Variation::Tolerance);
                cells.push(cell(varied(format!("tolerance {other:e}")), less, None, role));
            }
            for backend in backends {
                let role = Role::Varied(Variation::Backend);
                let name = varied(format!("backend {backend}"));
                cells.push(cell(name, method.clone(), Some(backend), role));
            }
        }
        Ok(())
    }

    /// The cell of the softness learned on `from`, on `task`; none if that is compared anyway or not bundled.
    fn crossed_cell(
        &self,
        task: &'static AnyTask,
        variant: Variant,
        runs: u32,
        from: &'static AnyTask,
        kind: &str,
    ) -> anyhow::Result<Option<Cell>> {
        let name = match kind.strip_prefix("learned") {
            Some(kind) if from.name != task.name => format!("learned-{}{kind}", from.name),
            _ => kind.to_owned(),
        };
        if self.methods.iter().any(|method| method.name == name) {
            return Ok(None);
        }
        let method = MethodArgs::parse(&name).map_err(anyhow::Error::msg)?;
        if !is_there(task, &method) {
            return Ok(None);
        }
        let role = Role::Crossed(from.name);
        Ok(Some(Cell { task, variant, method, name, backend: None, runs, role }))
    }

    fn runs_of(&self, k: usize, task: &AnyTask) -> u32 {
        let usual = task.paper.runs[usize::from(self.quick)];
        self.runs.get(k).or(self.runs.first()).copied().unwrap_or(usual)
    }

    /// Backends that the program was built with and the system supports, except the one in use.
    fn other_backends(&self) -> Vec<&'static str> {
        let all = compiled_backends!();
        let first = all.first().map(|backend| backend.name());
        let used = self.backend.as_deref().or(first);
        let others = all.iter().filter(|backend| Some(backend.name()) != used);
        others.filter(|backend| backend.set_up().is_ok()).map(|backend| backend.name()).collect()
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
        let cells = args("--quick --tasks shape2d,shape3d,pose,occlusion").cells().unwrap();
        // Eleven on every task; where edges move, a surrogate and four variations; on three tasks the learned softness, on one the searched
        // one; then the crossed ones.
        assert_eq!(cells.len(), 4 * 2 * 11 + 3 * 2 * (1 + 4) + (3 + 1) * 2 + 4 * 2 * 3);
        assert_eq!((cells[0].task.name, cells[18].variant), ("shape2d", Variant::Transfer));
        assert_eq!((&*cells[0].name, &*cells[12].name), ("preset", "preset resolution 128"));
        let preset = MethodArgs { softness: Some(SoftnessChoice::Preset), ..MethodArgs::default() };
        let is_default = |cell: &Cell| cell.method == preset && cell.role == Role::Compared;
        assert!(is_default(&cells[0]) && !is_default(&cells[12]));
        let learned = |task: &str| cells.iter().any(|c| c.task.name == task && c.name == "learned");
        assert!(learned("shape3d") && learned("pose") && learned("occlusion"));
        assert!(!learned("shape2d"), "what is the preset is not shown twice");
        let searched = cells.iter().filter(|cell| cell.name == "searched");
        assert!(
            searched.clone().count() == 2 && searched.clone().all(|c| c.task.name == "shape3d")
        );
        let alone =
            args("--tasks occlusion --methods learned --varied= --crossed=").cells().unwrap();
        assert_eq!(alone.len(), 2);
        let crossed: Vec<&str> = cells
            .iter()
            .filter(|c| matches!(c.role, Role::Crossed(_)))
            .map(|c| c.name.as_str())
            .collect();
        assert_eq!(crossed[..3], ["learned-shape3d", "learned-pose", "learned-occlusion"]);
        assert_eq!(crossed[21..], ["learned-shape2d", "learned-shape3d", "learned-pose"]);
        let some = args("--tasks pose --methods gauss,exp --varied exp --runs 7").cells().unwrap();
        assert!(some.len() == 8 && some[3].runs == 7 && some[2].name == "exp resolution 32");
        assert_eq!(args("--tasks pose --methods exp --varied=").cells().unwrap().len(), 2);
        let two = "--tasks pose,occlusion --methods exp --varied= --crossed learned-mlp";
        let two = args(two).cells().unwrap();
        assert_eq!([&two[4].name[..], &two[5].name], ["learned-mlp", "learned-occlusion-mlp"]);
        assert_eq!(two.len(), 2 * 2 + 2 * 2 * 2);
    }

    /// A task without a bundled softness.
    static DISC: AnyTask = AnyTask {
        name: "disc",
        title: "DISC",
        moves_edges: true,
        paper: &softrast_cli::Paper::NONE,
        entry: |_, _| unreachable!("nothing is evaluated"),
    };

    #[test]
    fn a_new_task_is_compared_by_what_needs_nothing_learned_on_it() {
        let line =
            "--methods preset,learned,learned-mlp,learned-surrogate,gauss,learned-pose --varied=";
        let mut cells = Vec::new();
        args(line).compared(&DISC, Variant::Original, 1, &[], &mut cells).unwrap();
        let names: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
        assert_eq!(names, ["gauss", "learned-pose"]);
    }

    #[test]
    fn seeds_are_one_number_or_one_for_each_task_and_nonsense_is_refused() {
        let runs = |line: &str| {
            let cells = args(&format!(
                "--tasks shape2d,shape3d,pose,occlusion --methods exp --varied= --crossed= {line}"
            ))
            .cells()
            .unwrap();
            cells.chunks(2).map(|of_task| of_task[0].runs).collect::<Vec<_>>()
        };
        assert_eq!(runs("--runs 3"), [3; 4]);
        assert_eq!(runs("--runs 20,5,60,50"), [20, 5, 60, 50]);
        assert!(args("--tasks shape2d,shape3d,pose,occlusion --runs 20,5").cells().is_err());
        for (flag, value, part) in
            [("--crossed", "learned-surrogate", "every task"), ("--methods", "sofft", "gumbel_min")]
        {
            let error = Args::try_parse_from(["compare", flag, value]).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let error = args("--tasks teapot").cells().err().unwrap().to_string();
        assert!(error.contains("shape2d"), "{error}");
    }
}
