//! A job that several processes share.

use crate::{
    Experiment, Partial, Runner,
    evaluate::{key_of, was_interrupted},
    store::key,
};

/// An experiment and its seeds.
pub struct Work<'a> {
    /// The experiment.
    pub experiment: &'a dyn Experiment,
    /// The seeds to run it on.
    pub seeds: &'a [u64],
    /// Whether the first seed has pictures.
    pub pictures: bool,
}

impl Runner {
    /// Makes the shard's runs of a job, or all runs without a shard. Returns the numbers of
    /// finished and of requested runs; they differ if the user stopped it.
    ///
    /// # Errors
    ///
    /// The errors of the experiments and of the store.
    pub fn part(&mut self, job: &[Work<'_>]) -> anyhow::Result<Partial> {
        let mine = self.mine(job);
        let steps = |(work, seeds): &(&Work<'_>, Vec<u64>)| work.experiment.steps() * seeds.len();
        self.progress.expect(mine.iter().map(steps).sum());
        let asked = mine.iter().map(|(_, seeds)| seeds.len()).sum();
        let mut finished = 0;
        for (work, seeds) in mine {
            match self.make(work, &seeds, &mut finished) {
                Err(stopped) if was_interrupted(&stopped) => break,
                made => made?,
            }
        }
        self.progress.finish();
        Ok(Partial { finished, asked })
    }

    /// With a shard, completes these experiments on all seeds: makes the shard's own runs, then those that no other shard has finished by
    /// then. Therefore no shard waits for another, and a killed one blocks nobody.
    ///
    /// # Errors
    ///
    /// The errors of the experiments and of the store; [`Error::Interrupted`](crate::Error::Interrupted) if the user stopped it.
    pub(crate) fn complete(
        &mut self,
        experiments: &[&dyn Experiment],
        seeds: &[u64],
    ) -> anyhow::Result<()> {
        let Some(shard) = self.store.shard() else { return Ok(()) };
        let work = |&experiment| Work { experiment, seeds, pictures: false };
        let stage: Vec<Work<'_>> = experiments.iter().map(work).collect();
        for (work, seeds) in self.mine(&stage) {
            self.make(work, &seeds, &mut 0)?;
        }
        loop {
            self.store.refresh()?;
            let mut missing = Vec::new();
            for work in &stage {
                let experiment = key(&work.experiment.identity());
                let is_missing =
                    |seed: &&u64| self.store.get(&key_of(&experiment, **seed)).is_none();
                missing.extend(work.seeds.iter().filter(is_missing).map(|&seed| (work, seed)));
            }
            // From the end, which their owners reach last.
            let Some(last) = missing.len().checked_sub(1) else { return Ok(()) };
            let (work, seed) = missing[last - shard.place(missing.len())];
            self.make(work, &[seed], &mut 0)?;
        }
    }

    /// The shard's runs of a job.
    fn mine<'a, 'b>(&self, job: &'a [Work<'b>]) -> Vec<(&'a Work<'b>, Vec<u64>)> {
        let (shard, mut before) = (self.store.shard(), 0);
        let of = |work: &'a Work<'b>| {
            let is_mine =
                |(k, _): &(usize, &u64)| shard.is_none_or(|shard| shard.takes(before + k));
            let seeds = work.seeds.iter().enumerate().filter(is_mine).map(|(_, &seed)| seed);
            let seeds = seeds.collect();
            before += work.seeds.len();
            (work, seeds)
        };
        job.iter().map(of).collect()
    }

    /// Makes some runs of a piece of work, and counts them.
    fn make(&mut self, work: &Work<'_>, seeds: &[u64], count: &mut usize) -> anyhow::Result<()> {
        for now in seeds.chunks(work.experiment.batch_size().max(1)) {
            let pictures = work.pictures && now[0] == work.seeds[0];
            let label = format!("{}, seed {}", work.experiment.name(), now[0]);
            *count += self.batch(work.experiment, now, pictures, label)?.len();
        }
        Ok(())
    }
}
