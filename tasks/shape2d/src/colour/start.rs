use std::collections::BinaryHeap;

use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::colour::Colours;

/// Start of the triangles of one run, with colours and depths.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Corners in NDC, three to a triangle.
    pub corners: Vec<[f64; 2]>,
    /// Red, green and blue of each triangle.
    pub colours: Vec<[f64; 3]>,
    /// Nearness of each triangle, from 0 to 1.
    pub nearness: Vec<f64>,
}

/// Largest distance of a cut from the middle of a side, as a share of the side.
const OFF_MIDDLE: f64 = 0.1;
/// Error per pixel of area in addition to the squared error of a triangle: negligible, except that in uniform regions the largest is cut.
const FOR_AREA: f64 = 1e-6;
/// Smallest and largest nearness at the start: depths have room to move either way.
const NEARNESS: [f64; 2] = [0.25, 0.75];

/// A triangle, with the colours of the picture in it.
#[derive(Clone, Copy)]
struct Piece {
    corners: [[f64; 2]; 3],
    mean: [f64; 3],
    /// Its error: the squared error summed over its pixels and their channels, plus a term for its area.
    wrong: f64,
}

impl Start {
    /// This many triangles that tile the image, each in the mean colour of its pixels; a single one covers half the image.
    ///
    /// Both halves of the image are cut repeatedly: always the triangle with the largest summed squared error, from near the middle of its
    /// longest side to the opposite corner. Detailed regions therefore get many small ones. The diagonal that halves the image, the places
    /// of cuts and the nearness of triangles depend on `seed`.
    pub fn seeded(seed: u64, triangles: usize, picture: &Colours) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let size = picture.size();
        let [x, y] = [size.width, size.height].map(|side| side as f64 / size.shorter() as f64);
        let mut diagonals = [[[-x, -y], [x, y]], [[x, -y], [-x, y]]];
        if random.random() {
            diagonals.swap(0, 1);
        }
        let [[from, to], others] = diagonals;
        let halves = others.map(|corner| Piece::new([from, to, corner], picture));
        let mut pieces = halves[..triangles.min(2)].to_vec();
        // The bits of non-negative numbers have the order of the numbers.
        let ranked = |(k, piece): (usize, &Piece)| (piece.wrong.to_bits(), k);
        let mut worst: BinaryHeap<_> = pieces.iter().enumerate().map(ranked).collect();
        while let Some((_, k)) = worst.pop().filter(|_| pieces.len() < triangles) {
            let cut = 0.5 + OFF_MIDDLE * (2.0 * random.random::<f64>() - 1.0);
            let [one, other] = pieces[k].cut(cut).map(|corners| Piece::new(corners, picture));
            worst.extend([(k, &one), (pieces.len(), &other)].map(ranked));
            pieces[k] = one;
            pieces.push(other);
        }
        let [least, largest] = NEARNESS;
        let nearness = pieces.iter().map(|_| least + (largest - least) * random.random::<f64>());
        Self {
            nearness: nearness.collect(),
            corners: pieces.iter().flat_map(|piece| piece.corners).collect(),
            colours: pieces.iter().map(|piece| piece.mean).collect(),
        }
    }
}

impl Piece {
    fn new(corners: [[f64; 2]; 3], picture: &Colours) -> Self {
        let (mut count, mut sum, mut squares) = (0.0, [0.0; 3], 0.0);
        picture.inside(&corners, |colour| {
            count += 1.0;
            sum = [0, 1, 2].map(|k| sum[k] + colour[k]);
            squares += colour.iter().map(|level| level * level).sum::<f64>();
        });
        let [u, v] = [1, 2].map(|k| [0, 1].map(|axis| corners[k][axis] - corners[0][axis]));
        // Half a pixel is one over the shorter side.
        let pixels = 0.25 * (picture.size().shorter() as f64).powi(2);
        let area = 0.5 * pixels * (u[0] * v[1] - u[1] * v[0]).abs();
        if count == 0.0 {
            // Smaller than a pixel.
            let centroid = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).sum::<f64>() / 3.0);
            return Self { corners, mean: picture.at(centroid), wrong: FOR_AREA * area };
        }
        let mean = sum.map(|sum| sum / count);
        let error = squares - count * mean.iter().map(|level| level * level).sum::<f64>();
        // Rounding can make the error negative.
        Self { corners, mean, wrong: error.max(0.0) + FOR_AREA * area }
    }

    /// Both parts after a cut at this share of the longest side.
    fn cut(&self, at: f64) -> [[[f64; 2]; 3]; 2] {
        let side = |k: usize| [self.corners[k], self.corners[(k + 1) % 3]];
        let length = |k: usize| {
            let [from, to] = side(k);
            (to[0] - from[0]).hypot(to[1] - from[1])
        };
        let longest = (1..3).fold(0, |a, b| if length(b) > length(a) { b } else { a });
        let ([from, to], across) = (side(longest), self.corners[(longest + 2) % 3]);
        let place = [0, 1].map(|axis| from[axis] + at * (to[axis] - from[axis]));
        [[from, place, across], [place, to, across]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::landscape;

    fn areas(start: &Start) -> Vec<f64> {
        let area = |t: &[[f64; 2]]| {
            let [u, v] = [1, 2].map(|k| [t[k][0] - t[0][0], t[k][1] - t[0][1]]);
            0.5 * (u[0] * v[1] - u[1] * v[0]).abs()
        };
        start.corners.chunks(3).map(area).collect()
    }

    #[test]
    fn triangles_are_the_image_without_holes_or_overlaps() {
        let picture = Colours::new(landscape(32), 32);
        for (triangles, expected) in [(1, 2.0), (2, 4.0), (3, 4.0), (250, 4.0)] {
            let start = Start::seeded(3, triangles, &picture);
            assert_eq!([start.nearness.len(), start.colours.len()], [triangles; 2]);
            let total: f64 = areas(&start).iter().sum();
            assert!((total - expected).abs() < 1e-9, "{triangles}: {total}");
            assert!(start.corners.iter().flatten().all(|x| x.abs() <= 1.0));
        }
    }

    #[test]
    fn triangles_are_small_where_the_picture_is_rich_and_even_where_it_is_not() {
        let half = |k: usize| if k % 32 < 16 { [0.5; 3] } else { [(k % 7) as f64 / 6.0; 3] };
        let start = Start::seeded(1, 200, &Colours::new((0..32 * 32).map(half).collect(), 32));
        let right = start.corners.chunks(3).filter(|t| t.iter().map(|c| c[0]).sum::<f64>() > 0.0);
        assert!(right.count() > 150);
        let flat = areas(&Start::seeded(1, 200, &Colours::new(vec![[0.3; 3]; 16], 4)));
        let [least, largest] = [f64::INFINITY, 0.0];
        let least = flat.iter().copied().fold(least, f64::min);
        let largest = flat.iter().copied().fold(largest, f64::max);
        assert!(largest < 4.0 * least, "{least} {largest}");
    }

    #[test]
    fn a_triangle_shows_the_mean_of_what_it_covers() {
        let picture = Colours::new(vec![[0.0, 0.5, 1.0], [1.0; 3], [0.0; 3], [1.0, 0.5, 0.0]], 2);
        let all = Piece::new([[-3.0, -1.0], [3.0, -1.0], [0.0, 9.0]], &picture);
        assert_eq!(all.mean, [0.5; 3]);
        let one = Piece::new([[0.1, 0.1], [0.9, 0.1], [0.5, 0.9]], &picture);
        assert!(one.mean == [1.0; 3] && one.wrong < 1e-5);
    }

    #[test]
    fn a_seed_gives_the_same_triangles_and_another_seed_others() {
        let picture = Colours::new(landscape(16), 16);
        assert_eq!(Start::seeded(1, 9, &picture), Start::seeded(1, 9, &picture));
        assert_ne!(Start::seeded(1, 9, &picture), Start::seeded(2, 9, &picture));
    }
}
