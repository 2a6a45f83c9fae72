/// Processes that share the work of an outer step. Their ranks count from 0.
pub trait Ranks {
    /// Rank of this process.
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn count(&self) -> usize;

    /// Concatenates the numbers of all ranks, in the order of ranks. Lengths may differ. All ranks must call this; it blocks until they do.
    fn gather(&self, numbers: &[f64]) -> Vec<f64>;
}

/// A single process.
///
/// ```
/// use softrast_meta::{Alone, Ranks};
///
/// assert_eq!((Alone.rank(), Alone.count()), (0, 1));
/// assert_eq!(Alone.gather(&[1.0, 2.0]), [1.0, 2.0]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Alone;

impl Ranks for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        1
    }

    fn gather(&self, numbers: &[f64]) -> Vec<f64> {
        numbers.to_vec()
    }
}

/// `of(k)` for every k below `count`, in order, on all ranks. Rank r of n computes k = r, r + n, ...
///
/// # Panics
///
/// If the lengths of all results together are no multiple of `count`.
pub(crate) fn shared(
    ranks: &dyn Ranks,
    count: usize,
    of: impl Fn(usize) -> Vec<f64>,
) -> Vec<Vec<f64>> {
    let (rank, all) = (ranks.rank(), ranks.count());
    let own: Vec<f64> = (rank..count).step_by(all).flat_map(of).collect();
    let gathered = ranks.gather(&own);
    assert!(gathered.len().is_multiple_of(count), "pieces of a batch are of one length");
    let width = gathered.len() / count;
    // Pieces are grouped by rank, in the order of ranks.
    let first =
        |rank: usize| (0..rank).map(|before| (before..count).step_by(all).count()).sum::<usize>();
    let place = |k: usize| first(k % all) + k / all;
    (0..count).map(|k| gathered[place(k) * width..(place(k) + 1) * width].to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use std::{
        sync::{Barrier, Mutex},
        thread,
    };

    use super::*;

    /// Threads as ranks.
    struct Threads<'a> {
        rank: usize,
        board: &'a [Mutex<Vec<f64>>],
        barrier: &'a Barrier,
    }

    impl Ranks for Threads<'_> {
        fn rank(&self) -> usize {
            self.rank
        }

        fn count(&self) -> usize {
            self.board.len()
        }

        fn gather(&self, numbers: &[f64]) -> Vec<f64> {
            *self.board[self.rank].lock().unwrap() = numbers.to_vec();
            self.barrier.wait();
            let all = self.board.iter().flat_map(|one| one.lock().unwrap().clone()).collect();
            self.barrier.wait();
            all
        }
    }

    #[test]
    fn every_rank_gets_all_pieces_in_order_also_where_there_are_more_ranks_than_pieces() {
        for count in [1, 2, 5, 8] {
            let of = |k: usize| vec![k as f64, -0.0, f64::NAN];
            let expected = format!("{:?}", shared(&Alone, count, of));
            for ranks in [1, 2, 3, 7] {
                let board: Vec<_> = (0..ranks).map(|_| Mutex::default()).collect();
                let barrier = Barrier::new(ranks);
                thread::scope(|scope| {
                    for rank in 0..ranks {
                        let (board, barrier, expected) = (&board, &barrier, &expected);
                        scope.spawn(move || {
                            let threads = Threads { rank, board, barrier };
                            assert_eq!(&format!("{:?}", shared(&threads, count, of)), expected);
                        });
                    }
                });
            }
        }
    }
}
