//! Remeshing of closed surfaces towards given edge lengths: short edges collapse, long ones are split, and edges are flipped towards
//! valence six.
//!
//! Source: Botsch and Kobbelt 2004; in an optimisation, Palfinger 2022.

mod collapse;
mod flip;
mod geometry;
mod half_edges;
mod split;

pub use geometry::SurfaceGeometry;
use half_edges::HalfEdges;

use crate::{
    Mesh, MeshError,
    vectors::{difference, dot, normal},
};

/// Edges shorter than this fraction of their target length collapse.
const SHORTEST: f32 = 0.8;
/// Least [`shape`] of a triangle after a change, unless it was lower before.
const THINNEST: f32 = 0.06;
/// Edges longer than this multiple of their target length are split.
const LONGEST: f32 = 4.0 / 3.0;

/// A closed surface with mutable topology, and numbers attached to its vertices.
///
/// Each vertex has a row of numbers: its position, the target length of edges around it, and custom numbers of the caller. The row of a new
/// vertex in the middle of an edge is the mean of those of both ends, and so is that of a merged vertex.
///
/// ```
/// use softrast_mesh::{ClosedSurface, icosphere};
///
/// let mut sphere = ClosedSurface::new(&icosphere(2), 0.1, 0)?;
/// let before = sphere.faces().len();
/// for _ in 0..5 {
///     sphere.remesh(10_000);
/// }
/// assert!(sphere.faces().len() > 4 * before);
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ClosedSurface {
    edges: HalfEdges,
    /// `[vertices, width]`.
    numbers: Vec<f32>,
    width: usize,
}

/// Numbers of changes of a pass over a surface.
///
/// ```
/// use softrast_mesh::{Changes, ClosedSurface, icosphere};
///
/// let mut sphere = ClosedSurface::new(&icosphere(2), 0.1, 0)?;
/// let Changes { split, .. } = sphere.remesh(10_000);
/// assert!(split > 0);
/// sphere.set_length(1.0);
/// assert!(sphere.remesh(10_000).collapsed > 0);
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Collapsed edges.
    pub collapsed: usize,
    /// Edges split at their midpoint.
    pub split: usize,
    /// Edges flipped to join the two opposite vertices.
    pub flipped: usize,
}

impl ClosedSurface {
    /// Column of the target length of edges around a vertex, after those of its position.
    pub const LENGTH: usize = 3;
    /// Number of columns before those of the caller.
    pub const OWN: usize = 4;

    /// The surface of a mesh, with target edge length `length` in its units, and `more` numbers of 0 for each vertex. Vertices without a
    /// face are excluded.
    ///
    /// # Errors
    ///
    /// If an edge does not have two faces in opposite directions, or the faces at a vertex do not form a single fan.
    ///
    /// # Panics
    ///
    /// If `length` is not positive and finite in 32 bits.
    pub fn new(mesh: &Mesh, length: f64, more: usize) -> Result<Self, MeshError> {
        let width = Self::OWN + more;
        let mut numbers = vec![0.0; mesh.positions().len() * width];
        for (row, place) in numbers.chunks_exact_mut(width).zip(mesh.positions()) {
            (0..3).for_each(|k| row[k] = place[k] as f32);
        }
        let mut edges = HalfEdges::new(mesh.faces(), mesh.positions().len())?;
        // Vertices without a face would never move.
        edges.compact(&mut numbers, width);
        let mut surface = Self { edges, numbers, width };
        surface.set_length(length);
        Ok(surface)
    }

    /// Vertices of each face, counterclockwise from outside.
    pub fn faces(&self) -> &[[u32; 3]] {
        self.edges.corners()
    }

    /// Numbers of all vertices, `[vertices, 4 + more]`: x, y, z, the target length of edges, and those of the caller.
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// Mutable numbers of all vertices. Lengths must stay positive.
    pub fn numbers_mut(&mut self) -> &mut [f32] {
        &mut self.numbers
    }

    /// N columns of all vertices from column `first` on, `[vertices, N]`.
    ///
    /// # Panics
    ///
    /// If there are fewer columns.
    pub fn columns<const N: usize>(&self, first: usize) -> Vec<f32> {
        let mut all = vec![0.0; N * self.vertices()];
        let rows = self.numbers.chunks_exact(self.width);
        for (to, row) in all.as_chunks_mut::<N>().0.iter_mut().zip(rows) {
            to.copy_from_slice(&row[first..first + N]);
        }
        all
    }

    /// Count of numbers per vertex.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.numbers.len() / self.width
    }

    /// Sets the target length of all edges.
    ///
    /// # Panics
    ///
    /// If `length` is not positive and finite in 32 bits.
    pub fn set_length(&mut self, length: f64) {
        let length = length as f32;
        assert!(length > 0.0 && length.is_finite(), "edges of length {length}");
        self.numbers.chunks_exact_mut(self.width).for_each(|row| row[Self::LENGTH] = length);
    }

    /// Number of faces that the target lengths ask for: the area of each face over that of an equilateral triangle whose sides are the
    /// mean of the target lengths at its corners.
    pub fn wanted_faces(&self) -> f64 {
        let of_face = |face: &[u32; 3]| {
            let across = normal(face.map(|v| place(&self.numbers, self.width, v)));
            let target = |v: u32| self.numbers[v as usize * self.width + Self::LENGTH];
            let side = face.iter().map(|&v| target(v)).sum::<f32>() / 3.0;
            let equilateral = 0.5 * 3f32.sqrt() * side * side;
            f64::from(dot(across, across).sqrt() / equilateral)
        };
        self.faces().iter().map(of_face).sum()
    }

    /// The surface as a mesh.
    ///
    /// # Errors
    ///
    /// If a position is not finite.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let rows = self.numbers.chunks_exact(self.width);
        let positions = rows.map(|row| [0, 1, 2].map(|k| f64::from(row[k])));
        Mesh::new(positions.collect(), self.faces().to_vec())
    }

    /// One pass over all edges: collapses those below four fifths of their target length, the mean of both ends; splits those above four
    /// thirds, while there are at most `most` faces; flips those for which the valences of the four adjacent vertices come closer to six.
    ///
    /// The surface stays closed and of its genus. No change turns a face by more than 60 degrees, makes a needle of it, or makes two edges
    /// between the same vertices.
    pub fn remesh(&mut self, most: usize) -> Changes {
        let Self { edges, numbers, width } = self;
        let changes = Changes {
            collapsed: edges.collapse_short(numbers, *width),
            split: edges.split_long(numbers, *width, most),
            flipped: edges.flip(numbers, *width),
        };
        edges.compact(numbers, *width);
        changes
    }
}

/// Position of a vertex.
#[inline(always)]
fn place(numbers: &[f32], width: usize, vertex: u32) -> [f32; 3] {
    let start = vertex as usize * width;
    [numbers[start], numbers[start + 1], numbers[start + 2]]
}

/// The target length of an edge, and its length.
#[inline(always)]
fn lengths(numbers: &[f32], width: usize, [a, b]: [u32; 2]) -> [f32; 2] {
    let target = |v: u32| numbers[v as usize * width + ClosedSurface::LENGTH];
    let along = difference(place(numbers, width, b), place(numbers, width, a));
    [0.5 * (target(a) + target(b)), dot(along, along).sqrt()]
}

/// Quality of a triangle: twice its area over the sum of its squared sides, 0 for a line, 0.29 if equilateral.
#[inline(always)]
fn shape(corners: [[f32; 3]; 3]) -> f32 {
    let [a, b, c] = corners;
    let sides = [difference(b, a), difference(c, b), difference(a, c)];
    let n = normal(corners);
    dot(n, n).sqrt() / sides.into_iter().map(|side| dot(side, side)).sum::<f32>()
}

/// Whether the cosine of the angle between two vectors is above `cosine`; false for a vector of length 0.
#[inline(always)]
fn are_within(a: [f32; 3], b: [f32; 3], cosine: f32) -> bool {
    // Products of squares of small triangles would leave the range of f32.
    let across = dot(a, b);
    across > cosine * dot(a, a).sqrt() * dot(b, b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::icosphere;

    /// Vertices - edges + faces, of a surface whose edges have two faces each.
    fn euler(surface: &ClosedSurface) -> i64 {
        surface.vertices() as i64 - surface.faces().len() as i64 / 2
    }

    fn checked(surface: &ClosedSurface) {
        HalfEdges::new(surface.faces(), surface.vertices()).expect("closed");
        let mesh = surface.mesh().unwrap();
        for [a, b, c] in mesh.triangles() {
            let narrow = |p: [f64; 3]| p.map(|x| x as f32);
            let n = normal([narrow(a), narrow(b), narrow(c)]);
            assert!(dot(n, n) > 0.0, "a face has no area");
        }
    }

    #[test]
    fn edges_come_near_to_their_length() {
        for length in [0.04, 0.15, 0.5] {
            let mut surface = ClosedSurface::new(&icosphere(3), length, 0).unwrap();
            (0..12).for_each(|_| _ = surface.remesh(100_000));
            checked(&surface);
            assert_eq!(euler(&surface), 2);
            let (mut sum, mut count) = (0.0, 0.0);
            for face in surface.faces() {
                for k in 0..3 {
                    let [_, found] = lengths(surface.numbers(), 4, [face[k], face[(k + 1) % 3]]);
                    (sum, count) = (sum + f64::from(found), count + 1.0);
                    assert!(f64::from(found) < 1.5 * length, "{found} for {length}");
                }
            }
            assert!((0.75..1.25).contains(&(sum / count / length)), "{}", sum / count / length);
        }
    }

    #[test]
    fn a_torus_stays_one() {
        let torus = |p: [f64; 3]| {
            let around = p[0].hypot(p[1]) - 0.7;
            around.hypot(p[2]) - 0.2
        };
        let mesh = Mesh::of_solid([[-1.0; 3], [1.0; 3]], 30, torus).unwrap();
        let mut surface = ClosedSurface::new(&mesh, 0.05, 2).unwrap();
        for length in [0.05, 0.3, 0.04, 0.2] {
            surface.set_length(length);
            (0..5).for_each(|_| _ = surface.remesh(100_000));
            checked(&surface);
            assert_eq!(euler(&surface), 0);
        }
    }

    #[test]
    fn numbers_of_new_vertices_are_means() {
        let mut surface = ClosedSurface::new(&icosphere(2), 0.1, 1).unwrap();
        surface.numbers_mut().chunks_exact_mut(5).for_each(|row| row[4] = 3.0 * row[0] - row[2]);
        (0..4).for_each(|_| _ = surface.remesh(100_000));
        for row in surface.numbers().chunks_exact(5) {
            assert!((row[4] - 3.0 * row[0] + row[2]).abs() < 1e-5, "{row:?}");
        }
    }

    #[test]
    fn wanted_faces_follow_from_lengths() {
        let mut surface = ClosedSurface::new(&icosphere(3), 0.1, 0).unwrap();
        (0..12).for_each(|_| _ = surface.remesh(100_000));
        let ratio = surface.wanted_faces() / surface.faces().len() as f64;
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
        let before = surface.wanted_faces();
        surface.set_length(0.2);
        assert!((surface.wanted_faces() / before - 0.25).abs() < 1e-3);
    }

    #[test]
    fn no_more_faces_than_are_allowed() {
        let mut surface = ClosedSurface::new(&icosphere(2), 0.01, 0).unwrap();
        (0..10).for_each(|_| _ = surface.remesh(1000));
        assert!(surface.faces().len() <= 1000 && surface.faces().len() > 990);
        checked(&surface);
    }

    #[test]
    fn lengths_may_differ_from_place_to_place() {
        let mut surface = ClosedSurface::new(&icosphere(3), 0.1, 0).unwrap();
        for _ in 0..10 {
            for row in surface.numbers_mut().chunks_exact_mut(4) {
                row[3] = if row[2] > 0.0 { 0.03 } else { 0.2 };
            }
            surface.remesh(100_000);
        }
        checked(&surface);
        let above = |face: &&[u32; 3]| place(surface.numbers(), 4, face[0])[2] > 0.0;
        let fine = surface.faces().iter().filter(above).count();
        assert!(fine > 20 * (surface.faces().len() - fine), "{fine}");
    }

    #[test]
    fn open_and_branching_surfaces_are_refused() {
        let ball = icosphere(1);
        let refused = |faces: Vec<[u32; 3]>| {
            let mesh = Mesh::new(ball.positions().to_vec(), faces).unwrap();
            ClosedSurface::new(&mesh, 0.1, 0).unwrap_err().to_string()
        };
        let open = ball.faces()[1..].to_vec();
        assert!(refused(open).starts_with("the mesh is not closed"));
        let mut turned = ball.faces().to_vec();
        turned[0].swap(0, 1);
        assert!(refused(turned).starts_with("the mesh is not closed"));
        // Two tetrahedra that share a vertex.
        let of = |v: [u32; 4]| {
            let [a, b, c, d] = v;
            [[a, b, c], [a, c, d], [a, d, b], [b, d, c]]
        };
        let touching = [of([0, 1, 2, 3]), of([0, 4, 5, 6])].concat();
        assert!(refused(touching).contains("vertex 0"));
    }
}
