use std::{env, fmt};

/// The share of a process in a job: every N-th run, N being the number of shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Counted from 0.
    index: usize,
    of: usize,
}

/// More processes are probably a typing error.
const MOST: usize = 100_000;

impl Shard {
    /// From `I/N`, with I from 1 to N; or from `auto`, which reads both from the environment of a Slurm array or of `mpirun`.
    ///
    /// # Errors
    ///
    /// The expected form.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Self::of_environment(|name| env::var(name).ok());
        }
        let numbers = text.split_once('/').and_then(|(index, of)| {
            let [index, of] = [index, of].map(|number| number.parse::<usize>().ok());
            Self::new(index?.checked_sub(1)?, of?)
        });
        numbers
            .ok_or_else(|| format!("expected I/N, with I from 1 to N and N up to {MOST}, or auto"))
    }

    fn new(index: usize, of: usize) -> Option<Self> {
        (index < of && of <= MOST).then_some(Self { index, of })
    }

    /// Sources: the manual of `sbatch`, Open MPI's `mpirun`, and the variables of Hydra and Slurm's PMI.
    fn of_environment(variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let number = |name: &str| variable(name)?.parse::<usize>().ok();
        let array = |part: &str| number(&format!("SLURM_ARRAY_TASK_{part}"));
        if let (Some(id), Some(of)) = (array("ID"), array("COUNT")) {
            let [least, most, step] = ["MIN", "MAX", "STEP"].map(array);
            let (least, step) = (least.unwrap_or(0), step.unwrap_or(1).max(1));
            let index = id.saturating_sub(least) / step;
            let is_even = most.is_none_or(|most| most == least + step * (of - 1))
                && id == least + step * index;
            return Self::new(index, of).filter(|_| is_even).ok_or_else(|| {
                "the numbers of this array of Slurm are not evenly spaced: say --shard I/N".into()
            });
        }
        for [rank, size] in
            [["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"], ["PMI_RANK", "PMI_SIZE"]]
        {
            if let (Some(rank), Some(size)) = (number(rank), number(size)) {
                return Self::new(rank, size)
                    .ok_or_else(|| format!("there is no rank {rank} of {size}"));
            }
        }
        Err("neither an array of Slurm nor mpirun is around: say --shard I/N".into())
    }

    /// Whether the `k`-th run of a job belongs to it.
    pub fn takes(self, k: usize) -> bool {
        k % self.of == self.index
    }

    /// An index below `count`, different for each of up to `count` shards.
    pub(crate) fn place(self, count: usize) -> usize {
        self.index % count
    }

    /// The shard as in the name of a file.
    pub(crate) fn in_name(self) -> String {
        format!("{}-of-{}", self.index + 1, self.of)
    }

    /// Whether a part of a file's name is that of a shard, possibly run again, such as `3-of-8.2`.
    pub(crate) fn is_in_name(part: &str) -> bool {
        let (shard, again) = part.split_once('.').unwrap_or((part, "2"));
        let is_number = |text: &str| text.parse::<usize>().is_ok();
        let numbers = shard.split_once("-of-");
        numbers.is_some_and(|(index, of)| [index, of, again].into_iter().all(is_number))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_is_one_of_so_many() {
        assert_eq!(Shard::parse("3/8").unwrap(), Shard { index: 2, of: 8 });
        for wrong in ["0/8", "9/8", "3", "/", "3/0", "1/100001", "-1/2", "a/b"] {
            assert!(Shard::parse(wrong).unwrap_err().contains("I/N"), "{wrong}");
        }
        let shards: Vec<Shard> = (0..3).map(|index| Shard { index, of: 3 }).collect();
        for k in 0..10 {
            assert_eq!(shards.iter().filter(|shard| shard.takes(k)).count(), 1);
        }
    }

    fn found(variables: &[(&str, &str)]) -> Result<Shard, String> {
        Shard::of_environment(|name| {
            variables.iter().find(|(one, _)| *one == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn the_environment_of_schedulers_is_known() {
        let slurm = |id, [count, min, max, step]: [&'static str; 4]| {
            let names = ["ID", "COUNT", "MIN", "MAX", "STEP"]
                .map(|part| format!("SLURM_ARRAY_TASK_{part}"));
            let values = [id, count, min, max, step];
            let pairs: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(values).collect();
            found(&pairs)
        };
        let third = Ok(Shard { index: 2, of: 4 });
        assert_eq!(slurm("2", ["4", "0", "3", "1"]), third);
        assert_eq!(slurm("3", ["4", "1", "4", "1"]), third);
        assert_eq!(slurm("14", ["4", "10", "16", "2"]), third);
        assert!(slurm("5", ["3", "1", "9", "1"]).unwrap_err().contains("evenly"));
        assert_eq!(found(&[("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "4")]), third);
        assert_eq!(found(&[("PMI_RANK", "2"), ("PMI_SIZE", "4")]), third);
        assert!(found(&[("HQ_TASK_ID", "2")]).unwrap_err().contains("I/N"));
    }

    #[test]
    fn files_of_shards_are_told_by_their_names() {
        assert_eq!(Shard { index: 2, of: 8 }.in_name(), "3-of-8");
        assert!(["3-of-8", "3-of-8.2"].into_iter().all(Shard::is_in_name));
        assert!(
            !["", "checkpoint", "3-of", "3-of-8.old", "3-of-8.2.3"]
                .into_iter()
                .any(Shard::is_in_name)
        );
    }
}
