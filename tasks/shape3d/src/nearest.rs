/// Points in a range of at most this length are compared one by one.
const LEAF: usize = 8;

/// Points sorted so that the nearest one is found without looking at all: a k-d tree.
///
/// The middle point of a range splits it along one axis: those before it are not beyond it, those
/// after it are not before it. Source: Bentley 1975.
pub(crate) struct Nearest {
    points: Vec<[f64; 3]>,
    /// Axis of the split at each point that splits.
    axes: Vec<u8>,
    /// Lowest and highest corner of the box around all points.
    bounds: [[f64; 3]; 2],
}

impl Nearest {
    pub(crate) fn new(mut points: Vec<[f64; 3]>) -> Self {
        let mut axes = vec![0; points.len()];
        split(&mut points, &mut axes);
        let bounds = bounds(&points);
        Self { points, axes, bounds }
    }

    /// Squared distance from `p` to the nearest point; infinite if there is none.
    pub(crate) fn squared_distance(&self, p: [f64; 3]) -> f64 {
        let [low, high] = self.bounds;
        let outside = [0, 1, 2].map(|k| (low[k] - p[k]).max(p[k] - high[k]).max(0.0));
        let mut best = f64::INFINITY;
        search(&self.points, &self.axes, p, outside, &mut best);
        best
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

fn bounds(points: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let start = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    points.iter().fold(start, |[low, high], p| {
        [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
    })
}

/// `outside` is how far `p` is from the box of these points along each axis: a lower bound that
/// leaves out whole ranges, however far all points are.
///
/// Source: Arya and Mount 1993 (incremental distance).
fn search(points: &[[f64; 3]], axes: &[u8], p: [f64; 3], outside: [f64; 3], best: &mut f64) {
    let squared = |q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
    if points.len() <= LEAF {
        *best = points.iter().map(squared).fold(*best, f64::min);
        return;
    }
    let middle = points.len() / 2;
    let axis = usize::from(axes[middle]);
    *best = best.min(squared(&points[middle]));
    let beyond = p[axis] - points[middle][axis];
    let before = (&points[..middle], &axes[..middle]);
    let after = (&points[middle + 1..], &axes[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (before, after) } else { (after, before) };
    search(near.0, near.1, p, outside, best);
    let mut across = outside;
    across[axis] = beyond.abs();
    if across.iter().map(|x| x * x).sum::<f64>() < *best {
        search(far.0, far.1, p, across, best);
    }
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
        for count in [1, 7, 8, 9, 10, 500] {
            let points = draw(count);
            let tree = Nearest::new(points.clone());
            // Beside the points, and far from all of them.
            let far = |p: &[f64; 3]| p.map(|x| 40.0 * x - 300.0);
            let near = draw(100);
            for p in near.iter().copied().chain(near.iter().map(far)) {
                let squared = |q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
                let least = points.iter().map(squared).fold(f64::INFINITY, f64::min);
                assert_eq!(tree.squared_distance(p), least);
            }
        }
    }
}
