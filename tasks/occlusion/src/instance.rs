use rand::{Rng, SeedableRng, rngs::StdRng, seq::SliceRandom};

use crate::{Pattern, Problem, Quad, Texture};

/// One instance: quads with unknown depths.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// The quads, whose positions in the image are fixed.
    pub quads: Vec<Quad>,
    /// Depth of each quad in the target picture; smaller is nearer.
    pub target: Vec<f64>,
    /// Depth of each quad at the start.
    pub start: Vec<f64>,
}

/// Colours that differ from one another and from a black background.
const PALETTE: [[f64; 3]; 8] = [
    [0.95, 0.25, 0.20],
    [0.25, 0.80, 0.30],
    [0.30, 0.50, 1.00],
    [1.00, 0.80, 0.20],
    [0.75, 0.35, 0.95],
    [0.20, 0.85, 0.90],
    [1.00, 0.55, 0.75],
    [0.95, 0.95, 0.95],
];

/// Sample points per side of the grid for measuring overlaps.
const GRID: usize = 40;
/// Sample points that suffice to show the order of two quads: 1 % of the image.
const ENOUGH: usize = GRID * GRID / 100;
/// Most attempts to place quads before insufficient overlaps are accepted.
const TRIES: usize = 10_000;

impl Instance {
    /// An instance that depends on `seed` alone.
    ///
    /// Depths are uniform in the range of the problem. Quads lie inside the image, turned by up to
    /// 35 degrees either way, each in a separate colour. They are placed so that the target
    /// determines the answer: for each pair whose order is to be found, at least 1 % of the image
    /// shows one of the two in front of the other. The start is drawn until its answer is wrong, so
    /// that there is something to find.
    ///
    /// Not in the paper, which gives only the number of quads and their depths.
    pub fn seeded(seed: u64, problem: &Problem) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let target = depths(&mut random, problem);
        let mut colours = PALETTE;
        colours.shuffle(&mut random);
        let mut quads = Vec::new();
        for _ in 0..TRIES {
            quads = (0..problem.quads)
                .map(|k| quad(&mut random, colours[k % colours.len()], problem))
                .collect();
            if tells_the_answer(&quads, &target, problem) {
                break;
            }
        }
        let mut start = depths(&mut random, problem);
        while problem.quads > 1 && is_answered(&start, &target, problem) {
            start = depths(&mut random, problem);
        }
        Self { quads, target, start }
    }

    /// For each pair of quads, the number of pixels in an image of `size` × `size` that show one of
    /// the two in front of the other; pairs (0, 1), (0, 2), …, (1, 2), ….
    pub fn visible_overlaps(&self, size: usize) -> Vec<usize> {
        visible_overlaps(&self.quads, &self.target, size)
    }
}

/// Pairs of indices below `count`, the smaller one first.
pub(crate) fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |i| (i + 1..count).map(move |j| (i, j)))
}

/// Index of the quad with the smallest depth, the first of equal ones.
pub(crate) fn front(depths: &[f64]) -> usize {
    (0..depths.len()).reduce(|a, b| if depths[b] < depths[a] { b } else { a }).unwrap_or(0)
}

/// Centres of the pixels of an image of `size` × `size` in NDC, top row first.
pub(crate) fn places(size: usize) -> impl Iterator<Item = [f64; 2]> {
    let centre = move |index: usize| (2.0 * index as f64 + 1.0 - size as f64) / size as f64;
    (0..size * size).map(move |k| [centre(k % size), centre(size - 1 - k / size)])
}

fn depths(random: &mut StdRng, problem: &Problem) -> Vec<f64> {
    let [least, largest] = problem.depths;
    (0..problem.quads).map(|_| least + (largest - least) * random.random::<f64>()).collect()
}

/// A random quad in the image.
fn quad(random: &mut StdRng, colour: [f64; 3], problem: &Problem) -> Quad {
    let mut between = |least: f64, largest: f64| least + (largest - least) * random.random::<f64>();
    // Many quads must be closer together to overlap in pairs.
    let reach = if problem.front_only { 0.3 } else { 0.4 };
    loop {
        let pattern = Pattern::ALL[between(0.0, 3.0) as usize];
        let texture = Texture { colour, pattern, fields: between(3.0, 7.0) as usize };
        let quad = Quad {
            centre: [between(-reach, reach), between(-reach, reach)],
            half: [between(0.3, 0.55), between(0.3, 0.55)],
            angle_deg: between(-35.0, 35.0),
            texture,
        };
        if quad.corners().iter().flatten().all(|x| x.abs() < 0.97) {
            return quad;
        }
    }
}

fn visible_overlaps(quads: &[Quad], depths: &[f64], size: usize) -> Vec<usize> {
    let mut counts = vec![0; pairs(quads.len()).count()];
    for place in places(size) {
        let mut covering: Vec<usize> =
            (0..quads.len()).filter(|&k| quads[k].distance(place) >= 0.0).collect();
        covering.sort_by(|&a, &b| depths[a].total_cmp(&depths[b]));
        let Some((&seen, behind)) = covering.split_first() else { continue };
        for (count, (i, j)) in counts.iter_mut().zip(pairs(quads.len())) {
            let other = if seen == i { j } else { i };
            *count += usize::from((seen == i || seen == j) && behind.contains(&other));
        }
    }
    counts
}

/// Whether the target determines the answer.
fn tells_the_answer(quads: &[Quad], target: &[f64], problem: &Problem) -> bool {
    let nearest = front(target);
    let asked = |(i, j): (usize, usize)| !problem.front_only || i == nearest || j == nearest;
    let counts = visible_overlaps(quads, target, GRID);
    counts.into_iter().zip(pairs(quads.len())).all(|(count, pair)| !asked(pair) || count >= ENOUGH)
}

/// Whether `depths` already have the answer of `target`.
fn is_answered(depths: &[f64], target: &[f64], problem: &Problem) -> bool {
    if problem.front_only {
        return front(depths) == front(target);
    }
    pairs(depths.len()).all(|(i, j)| (depths[i] < depths[j]) == (target[i] < target[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_tell_the_answer_and_starts_do_not_have_it() {
        for problem in [Problem::ORIGINAL, Problem::TRANSFER] {
            let [least, largest] = problem.depths;
            for seed in 0..100 {
                let instance = Instance::seeded(seed, &problem);
                let Instance { quads, target, start } = &instance;
                assert_eq!([quads.len(), target.len(), start.len()], [problem.quads; 3]);
                assert!(tells_the_answer(quads, target, &problem), "seed {seed}");
                assert!(!is_answered(start, target, &problem), "seed {seed}");
                assert!(target.iter().chain(start).all(|z| (least..largest).contains(z)));
                let colours: Vec<_> = quads.iter().map(|quad| quad.texture.colour).collect();
                assert!(pairs(colours.len()).all(|(i, j)| colours[i] != colours[j]));
                assert_eq!(instance, Instance::seeded(seed, &problem));
            }
        }
    }

    #[test]
    fn overlaps_are_counted_where_they_are_seen() {
        let texture = Texture { colour: [1.0; 3], pattern: Pattern::Checks, fields: 2 };
        let half = [0.5, 1.0];
        let quad = |x: f64| Quad { centre: [x, 0.0], half, angle_deg: 0.0, texture };
        // Columns 0 and 1, 1 and 2, 0 to 3 of an image of 4 columns.
        let wide = Quad { half: [1.0, 1.0], ..quad(0.0) };
        let quads = vec![quad(-0.5), quad(0.0), wide];
        let counts = |target: [f64; 3]| {
            let instance = Instance { quads: quads.clone(), target: target.into(), start: vec![] };
            instance.visible_overlaps(4)
        };
        assert_eq!(counts([1.0, 2.0, 3.0]), [4, 8, 4]);
        assert_eq!(counts([2.0, 3.0, 1.0]), [0, 8, 8]);
    }

    #[test]
    fn one_quad_alone_is_an_instance() {
        let problem = Problem { quads: 1, ..Problem::ORIGINAL };
        assert!(Instance::seeded(3, &problem).visible_overlaps(8).is_empty());
    }
}
