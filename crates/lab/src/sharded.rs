//! A job that several processes share.

use crate::{
    Experiment, Partial, Runner,
    evaluate::{key_of, was_interrupted},
    store::key,
};

/// An experiment and the seeds that it is to be run on.
pub struct Work<'a> {
    /// What is run.
    pub experiment: &'a dyn Experiment,
    /// On which seeds.
    pub seeds: &'a [u64],
    /// Whether the first seed brings pictures.
    pub pictures: bool,
}

impl Runner {
    /// Makes the runs of a job that are its shard's; all of them where there is no shard. How many of those are finished, and of how many;
    /// fewer if the user stopped it.
    ///
    /// # Errors
    ///
    /// Those of the experiments and of the store.
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

    /// Makes sure that these experiments are finished on all seeds, where there is a shard: makes its own, then those that no other shard has
    /// finished by then. So no shard waits for another, and one that was killed holds nobody up.
    ///
    /// # Errors
    ///
    /// Those of the experiments and of the store; [`Error::Interrupted`](crate::Error::Interrupted) if the user stopped it.
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
            // From the end, which their owners come to last.
            let Some(last) = missing.len().checked_sub(1) else { return Ok(()) };
            let (work, seed) = missing[last - shard.place(missing.len())];
            self.make(work, &[seed], &mut 0)?;
        }
    }

    /// What of a job is its shard's.
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
