use rayon::prelude::*;

/// Points in a range of at most this length are compared one by one.
const LEAF: usize = 16;
/// Points searched together: neighbours share much of the traversal, and their distances to a point are vectorized.
const GROUP: usize = 8;

/// Points sorted so that the nearest one is found without visiting all: a k-d tree.
///
/// The middle point of a range splits it along one axis: those before it are not beyond it, those
/// after it are not before it. Source: Bentley 1975.
///
/// ```
/// use softrast_kernel::Nearest;
///
/// let [two, one] = [vec![[0.0; 3], [2.0, 0.0, 0.0]], vec![[0.0; 3]]].map(Nearest::new);
/// // Only one of the two points is away from the other set, by 2.
/// assert_eq!((two.mean_squared_distance(&one), one.mean_squared_distance(&two)), (2.0, 0.0));
/// ```
pub struct Nearest {
    /// Neighbours in this order are mostly neighbours in space.
    points: Vec<[f64; 3]>,
    /// Axis of the split at each point that splits.
    axes: Vec<u8>,
    bounds: Bounds,
}

/// Lowest and highest corner of a box.
type Bounds = [[f64; 3]; 2];

impl Nearest {
    /// The tree of `points` `[x, y, z]`, finite, in any one unit; may be empty.
    pub fn new(mut points: Vec<[f64; 3]>) -> Self {
        let mut axes = vec![0; points.len()];
        split(&mut points, &mut axes);
        let bounds = bounds(&points);
        Self { points, axes, bounds }
    }

    /// Mean over these points of the squared distance to the nearest of `others`, in the square of their unit: 0 if there are no points
    /// here, infinite if `others` is empty.
    pub fn mean_squared_distance(&self, others: &Self) -> f64 {
        // Collected, then summed in order: the sum does not depend on the number of threads.
        let groups = self.points.par_chunks(GROUP);
        let squared: Vec<f64> = groups.map(|group| others.sum_of_squares(group)).collect();
        squared.iter().sum::<f64>() / self.points.len().max(1) as f64
    }

    /// Sum over a few points of the squared distance to the nearest of these.
    fn sum_of_squares(&self, points: &[[f64; 3]]) -> f64 {
        let mut group = Group::new(points);
        let ([low, high], [least, most]) = (self.bounds, group.bounds);
        let outside = [0, 1, 2].map(|k| (low[k] - most[k]).max(least[k] - high[k]).max(0.0));
        group.search(&self.points, &self.axes, outside);
        group.best[..points.len()].iter().sum()
    }
}

/// Points searched together; if there are fewer than [`GROUP`], the last one is repeated.
struct Group {
    /// By axis.
    at: [[f64; GROUP]; 3],
    bounds: Bounds,
    /// Squared distance of each point to the nearest one visited, and the largest of these.
    best: [f64; GROUP],
    worst: f64,
}

impl Group {
    fn new(points: &[[f64; 3]]) -> Self {
        let point = |k: usize| points[k.min(points.len() - 1)];
        Self {
            at: [0, 1, 2].map(|axis| std::array::from_fn(|k| point(k)[axis])),
            bounds: bounds(points),
            best: [f64::INFINITY; GROUP],
            worst: f64::INFINITY,
        }
    }

    /// `outside` is the distance of the group from the box of these points along each axis: a lower bound that excludes whole ranges,
    /// however far all points are.
    ///
    /// Source: Arya and Mount 1993 (incremental distance).
    fn search(&mut self, points: &[[f64; 3]], axes: &[u8], outside: [f64; 3]) {
        if points.len() <= LEAF {
            points.iter().for_each(|q| self.meet(q));
            self.worst = self.best.iter().copied().fold(0.0, f64::max);
            return;
        }
        let middle = points.len() / 2;
        let (axis, split) = (usize::from(axes[middle]), points[middle]);
        self.meet(&split);
        let [low, high] = self.bounds.map(|corner| corner[axis] - split[axis]);
        let before = (&points[..middle], &axes[..middle]);
        let after = (&points[middle + 1..], &axes[middle + 1..]);
        // On the side of the middle of the group first.
        let (near, far, gap) =
            if low + high < 0.0 { (before, after, -high) } else { (after, before, low) };
        self.search(near.0, near.1, outside);
        let mut across = outside;
        across[axis] = across[axis].max(gap);
        if across.iter().map(|x| x * x).sum::<f64>() < self.worst {
            self.search(far.0, far.1, across);
        }
    }

    fn meet(&mut self, q: &[f64; 3]) {
        for k in 0..GROUP {
            let [x, y, z] = [0, 1, 2].map(|axis| self.at[axis][k] - q[axis]);
            let squared = x * x + y * y + z * z;
            // Not `f64::min`, which also handles NaN.
            self.best[k] = if squared < self.best[k] { squared } else { self.best[k] };
        }
    }
}

fn split(points: &mut [[f64; 3]], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let axis = widest(points);
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    axes[middle] = axis as u8;
    let (before, after) = points.split_at_mut(middle);
    let (axes_before, axes_after) = axes.split_at_mut(middle);
    split(before, axes_before);
    split(&mut after[1..], &mut axes_after[1..]);
}

/// The axis along which the points spread most.
fn widest(points: &[[f64; 3]]) -> usize {
    let [low, high] = bounds(points);
    let spread = |&a: &usize, &b: &usize| (high[a] - low[a]).total_cmp(&(high[b] - low[b]));
    (0..3).max_by(spread).unwrap_or(0)
}

fn bounds(points: &[[f64; 3]]) -> Bounds {
    let start = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    points.iter().fold(start, |[low, high], p| {
        [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;

    #[test]
    fn the_tree_finds_what_looking_at_all_points_finds() {
        let mut random = StdRng::seed_from_u64(0);
        let mut draw = |count: usize| -> Vec<[f64; 3]> {
            // Few distinct coordinates, so that many points coincide or share a plane.
            (0..count).map(|_| [(); 3].map(|()| f64::from(random.random_range(0..20)))).collect()
        };
        for count in [1, 15, 16, 17, 34, 500] {
            let points = draw(count);
            let tree = Nearest::new(points.clone());
            // Groups near the points and far from them; alone and mixed.
            let far = |p: &[f64; 3]| p.map(|x| 40.0 * x - 300.0);
            let near = draw(100);
            let all: Vec<[f64; 3]> = near.iter().copied().chain(near.iter().map(far)).collect();
            let squared = |p: &[f64; 3]| {
                let to = |q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
                points.iter().map(to).fold(f64::INFINITY, f64::min)
            };
            for size in [1, 3, GROUP] {
                for group in all.chunks(size) {
                    // Whole numbers: exact in any order.
                    let expected: f64 = group.iter().map(squared).sum();
                    assert_eq!(tree.sum_of_squares(group), expected);
                }
            }
            let mean = all.iter().map(squared).sum::<f64>() / all.len() as f64;
            assert_eq!(Nearest::new(all).mean_squared_distance(&tree), mean);
            let none = Nearest::new(Vec::new());
            assert_eq!(none.mean_squared_distance(&tree), 0.0);
            assert_eq!(tree.mean_squared_distance(&none), f64::INFINITY);
        }
    }
}
