//! Accumulates the gradients of faces into their vertices.

use rayon::prelude::*;

use super::{lanes::Float, tasks::task};

/// Faces per block; a task skips the blocks without vertices in its range.
const AT_ONCE: usize = 1 << 12;
/// Number of vertex ranges that threads may take, and the fewest vertices of a range.
const RANGES: usize = 16;
const LEAST: usize = 1 << 13;
/// Ranges are separate tasks if on average at most this many of them visit a block, as where vertices are in the order of faces.
const MOST_LOOKS: usize = 2;

/// Numbers for the x and y of the three corners of some faces, and a factor of all of them.
pub(crate) struct Part<'a, F> {
    /// In ascending order.
    pub(crate) faces: &'a [u32],
    pub(crate) corners: &'a [[F; 6]],
    pub(crate) factor: F,
}

/// Adds parts to the first two rows of `vertices`, `[3, vertices]`, in order.
///
/// Each range of vertices is a separate task if few faces have vertices in several ranges. The order of each vertex's sum is the same.
pub(crate) fn gather<F: Float>(faces: &[[u32; 3]], parts: &[Part<F>], vertices: &mut [F]) {
    let (x, rest) = vertices.split_at_mut(vertices.len() / 3);
    let own = x.len().div_ceil(RANGES).max(LEAST);
    let spans: Vec<[u32; 2]> = match x.len() > own {
        true => faces.par_chunks(AT_ONCE).map(span).collect(),
        false => Vec::new(),
    };
    // Number of visits of blocks by all ranges together.
    let ranges = |&[least, largest]: &[u32; 2]| (largest as usize / own + 1) - least as usize / own;
    let looks = spans.iter().map(ranges).sum::<usize>();
    if looks > MOST_LOOKS * spans.len() || spans.is_empty() {
        return task("gather", || add(faces, parts, &[], 0, [x, rest]));
    }
    let y = &mut rest[..x.len()];
    let ranges = x.par_chunks_mut(own).zip(y.par_chunks_mut(own)).enumerate();
    ranges.for_each(|(range, (x, y))| {
        task("gather", || add(faces, parts, &spans, range * own, [x, y]));
    });
}

/// The least and the largest vertex of some faces.
fn span(faces: &[[u32; 3]]) -> [u32; 2] {
    let corners = faces.as_flattened().iter();
    corners.fold([u32::MAX, 0], |[least, largest], &v| [least.min(v), largest.max(v)])
}

/// Adds parts to the vertices from `first` on. `spans` are the spans of each [`AT_ONCE`] faces, or empty if all faces are visited.
fn add<F: Float>(
    faces: &[[u32; 3]],
    parts: &[Part<F>],
    spans: &[[u32; 2]],
    first: usize,
    [x, y]: [&mut [F]; 2],
) {
    for &Part { faces: numbers, corners, factor } in parts {
        let mut start = 0;
        while start < numbers.len() {
            let chunk = numbers[start] as usize / AT_ONCE;
            let same = |number: &u32| (*number as usize) / AT_ONCE <= chunk;
            let end = match spans {
                [] => numbers.len(),
                _ => start + numbers[start..].partition_point(same),
            };
            let (own, corners) = (&numbers[start..end], &corners[start..end]);
            start = end;
            if let Some(&[least, largest]) = spans.get(chunk)
                && ((largest as usize) < first || least as usize >= first + x.len())
            {
                continue;
            }
            for (&face, corners) in own.iter().zip(corners) {
                for (&vertex, xy) in faces[face as usize].iter().zip(corners.chunks_exact(2)) {
                    // Vertices before the first wrap around to beyond the last.
                    let at = (vertex as usize).wrapping_sub(first);
                    if let Some(x) = x.get_mut(at) {
                        *x += xy[0] * factor;
                        y[at] += xy[1] * factor;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of faces, whose vertices have these numbers.
    fn assert_added(number: impl Fn(u32) -> u32, tasks: usize) {
        let count = 40_000;
        let faces: Vec<[u32; 3]> =
            (0..count - 2).map(|k| [0, 1, 2].map(|i| number(k + i))).collect();
        let wave = |k: usize| (1.3 * k as f64).sin();
        let corners: Vec<[f64; 6]> =
            (0..faces.len()).map(|f| std::array::from_fn(|i| wave(7 * f + i))).collect();
        let all: Vec<u32> = (0..faces.len() as u32).collect();
        let odd: Vec<u32> = all.iter().copied().filter(|face| face % 2 == 1).collect();
        let parts = [
            Part { faces: &all, corners: &corners, factor: 1.0 },
            Part { faces: &odd, corners: &corners[..odd.len()], factor: -0.5 },
        ];
        let mut expected = vec![0.0; 3 * count as usize];
        for Part { faces: numbers, corners, factor } in &parts {
            for (&face, corners) in numbers.iter().zip(*corners) {
                for (k, &vertex) in faces[face as usize].iter().enumerate() {
                    expected[vertex as usize] += corners[2 * k] * factor;
                    expected[(count + vertex) as usize] += corners[2 * k + 1] * factor;
                }
            }
        }
        let mut found = vec![0.0; 3 * count as usize];
        let (_, recorded) = crate::recorded_tasks(|| gather(&faces, &parts, &mut found));
        assert!(found == expected, "another sum, or another order");
        assert_eq!(recorded.iter().filter(|(phase, _)| *phase == "gather").count(), tasks);
    }

    #[test]
    fn ranges_of_vertices_add_up_to_the_same_bits_as_one_task() {
        assert_added(|k| k, 5);
        // Neighbours are far apart: one task.
        assert_added(|k| k * 7_919 % 40_000, 1);
    }
}
