use std::env;

use crate::Error;

/// The processes that `mpirun` started together, each a rank; a single one without `mpirun`.
///
/// Several processes need the feature `mpi`.
pub struct World {
    #[cfg(feature = "mpi")]
    joined: Option<joined::Joined>,
}

impl World {
    /// A single process.
    pub fn alone() -> Self {
        Self {
            #[cfg(feature = "mpi")]
            joined: None,
        }
    }

    /// Joins the other processes, for the lifetime of this value.
    ///
    /// A rank that panics ends all.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if there are several processes, but the program is built without `mpi`.
    pub fn join() -> Result<Self, Error> {
        let number = |name| env::var(name).ok()?.parse::<usize>().ok();
        let started = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"].into_iter().find_map(number);
        #[cfg(feature = "mpi")]
        return Ok(Self { joined: started.and_then(|_| joined::Joined::new()) });
        #[cfg(not(feature = "mpi"))]
        match started {
            Some(2..) => Err(Error::Usage(
                "mpirun has started several processes, but this program is built without MPI: build it with --features mpi".into(),
            )),
            _ => Ok(Self {}),
        }
    }

    /// Rank of this process, counted from 0.
    pub fn rank(&self) -> usize {
        #[cfg(feature = "mpi")]
        return self.joined.as_ref().map_or(0, joined::Joined::rank);
        #[cfg(not(feature = "mpi"))]
        0
    }

    /// Number of ranks.
    pub fn count(&self) -> usize {
        #[cfg(feature = "mpi")]
        return self.joined.as_ref().map_or(1, joined::Joined::count);
        #[cfg(not(feature = "mpi"))]
        1
    }

    /// Whether this rank writes and prints.
    pub fn is_first(&self) -> bool {
        self.rank() == 0
    }

    /// Concatenates the numbers of all ranks, in their order. Lengths may differ. All must call this; it blocks until they do.
    pub fn gather(&self, numbers: &[f64]) -> Vec<f64> {
        #[cfg(feature = "mpi")]
        if let Some(joined) = &self.joined {
            return joined.gather(numbers);
        }
        numbers.to_vec()
    }

    /// Copies the numbers of `root` to all ranks. All must call this, with slices of one length.
    pub fn broadcast(&self, root: usize, numbers: &mut [f32]) {
        #[cfg(feature = "mpi")]
        if let Some(joined) = &self.joined {
            return joined.broadcast(root, numbers);
        }
        let _ = (root, numbers);
    }

    /// Whether `yes` is true on any rank. All must call this.
    pub fn any(&self, yes: bool) -> bool {
        self.gather(&[f64::from(u8::from(yes))]).iter().any(|&said| said > 0.0)
    }

    /// Ends all ranks because this one has failed, so that none waits for it; a single process returns the error.
    pub fn fail(&self, error: anyhow::Error) -> anyhow::Error {
        #[cfg(feature = "mpi")]
        if let Some(joined) = &self.joined {
            joined.fail(&error.into());
        }
        error
    }
}

#[cfg(feature = "mpi")]
mod joined {
    use std::{panic, thread, time::Duration};

    use mpi::{
        Threading, collective::CommunicatorCollectives, environment::Universe,
        topology::SimpleCommunicator, traits::*,
    };

    use crate::Failure;

    /// Joined processes. On drop, the universe is left first, and then waited after.
    pub(super) struct Joined {
        universe: Universe,
        _left: Left,
    }

    /// Waits briefly on drop: on a busy machine, `mpirun` of Open MPI 4 may treat a process that
    /// ends right after leaving as crashed.
    struct Left;

    impl Drop for Left {
        fn drop(&mut self) {
            thread::sleep(Duration::from_millis(300));
        }
    }

    impl Joined {
        pub(super) fn new() -> Option<Self> {
            let (universe, _) = mpi::initialize_with_threading(Threading::Serialized)?;
            let hook = panic::take_hook();
            panic::set_hook(Box::new(move |panic| {
                hook(panic);
                SimpleCommunicator::world().abort(101);
            }));
            Some(Self { universe, _left: Left })
        }

        pub(super) fn rank(&self) -> usize {
            self.universe.world().rank().unsigned_abs() as usize
        }

        pub(super) fn count(&self) -> usize {
            self.universe.world().size().unsigned_abs() as usize
        }

        pub(super) fn gather(&self, numbers: &[f64]) -> Vec<f64> {
            use mpi::datatype::PartitionMut;
            let world = self.universe.world();
            let own = i32::try_from(numbers.len()).expect("fewer numbers than an i32 counts");
            let mut counts = vec![0; self.count()];
            world.all_gather_into(&own, &mut counts[..]);
            let starts: Vec<i32> = counts
                .iter()
                .scan(0, |sum, count| {
                    *sum += count;
                    Some(*sum - count)
                })
                .collect();
            let mut all = vec![0.0; counts.iter().sum::<i32>().unsigned_abs() as usize];
            let mut parts = PartitionMut::new(&mut all[..], counts, &starts[..]);
            world.all_gather_varcount_into(numbers, &mut parts);
            all
        }

        pub(super) fn broadcast(&self, root: usize, numbers: &mut [f32]) {
            let root = i32::try_from(root).expect("a rank is an i32");
            self.universe.world().process_at_rank(root).broadcast_into(numbers);
        }

        pub(super) fn fail(&self, failure: &Failure) -> ! {
            // An error on all ranks is printed once: by the first, which ends the others.
            if self.rank() > 0 {
                thread::sleep(Duration::from_secs(1));
            }
            eprintln!("{failure}");
            self.universe.world().abort(failure.code.into())
        }
    }
}
