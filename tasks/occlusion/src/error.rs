use crate::instance::{front, pairs};

/// Error of the depths relative to the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthError {
    /// Share of all pairs of quads that are in the wrong order, also of pairs whose order a nearer
    /// quad hides in the target; a tie is wrong.
    pub wrong_pairs: f64,
    /// Mean absolute difference of the depths. An image without perspective determines only the
    /// order of depths, so this need not fall.
    pub distance: f64,
    /// Whether the front quad is that of the target, without a tie.
    pub right_front: bool,
}

impl DepthError {
    /// The error of the depths `found` against those of the target.
    ///
    /// Not in the paper, which leaves its measure of the depth undefined.
    ///
    /// # Panics
    ///
    /// If there are no depths, or not as many as in the target.
    pub fn new(found: &[f64], target: &[f64]) -> Self {
        let count = found.len();
        assert!(count > 0 && count == target.len(), "{count} depths against {}", target.len());
        let wrong = |&(i, j): &(usize, usize)| {
            let nearer = found[i].partial_cmp(&found[j]);
            nearer != target[i].partial_cmp(&target[j])
        };
        let (all, wrong) = (pairs(count).count(), pairs(count).filter(wrong).count());
        let distance = found.iter().zip(target).map(|(f, t)| (f - t).abs()).sum::<f64>();
        let nearest = front(found);
        let alone = (0..count).all(|k| k == nearest || found[k] > found[nearest]);
        Self {
            wrong_pairs: wrong as f64 / all.max(1) as f64,
            distance: distance / count as f64,
            right_front: alone && nearest == front(target),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_in_the_wrong_order_are_counted() {
        let target = [1.0, 2.0, 3.0];
        for (found, wrong, right_front) in [
            ([0.0, 0.1, 0.2], 0.0, true),
            ([0.0, 0.2, 0.1], 1.0, true),
            ([0.1, 0.0, 0.2], 1.0, false),
            ([3.0, 2.0, 1.0], 3.0, false),
            ([5.0, 5.0, 5.0], 3.0, false),
            ([0.0, 5.0, 5.0], 1.0, true),
        ] {
            let error = DepthError::new(&found, &target);
            assert_eq!(
                (3.0 * error.wrong_pairs, error.right_front),
                (wrong, right_front),
                "{found:?}"
            );
        }
    }

    #[test]
    fn one_quad_has_no_order_to_miss() {
        let error = DepthError::new(&[2.0], &[0.5]);
        assert_eq!(error, DepthError { wrong_pairs: 0.0, distance: 1.5, right_front: true });
    }
}
