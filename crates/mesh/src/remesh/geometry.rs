use rayon::prelude::*;

use crate::vectors::{cross, difference, dot, normal};

/// Least length by which normals are divided; those of vertices whose faces have no area are shorter.
const LEAST: f32 = 1e-30;
/// Faces or vertices per parallel task.
const AT_ONCE: usize = 1 << 11;

/// Positions and normals of the vertices of a closed surface, each of which has a face, as flat lists of three numbers per vertex.
///
/// ```
/// use softrast_mesh::{SurfaceGeometry, icosphere};
///
/// let ball = icosphere(3);
/// let positions = ball.positions().iter().flatten().map(|&x| x as f32).collect();
/// let mut surface = SurfaceGeometry::new(ball.faces(), positions);
/// // The normal of a unit sphere is the position, and the mean of the neighbours is further inside.
/// assert!(surface.normals().iter().zip(surface.positions()).all(|(n, p)| (n - p).abs() < 0.02));
/// let inwards = surface.umbrella(surface.positions());
/// assert!(inwards.iter().zip(surface.positions()).map(|(d, p)| d * p).sum::<f32>() < 0.0);
/// let area = surface.area(ball.faces());
/// surface.move_to(ball.faces(), surface.positions().iter().map(|x| 2.0 * x).collect());
/// assert!((surface.area(ball.faces()) / area - 4.0).abs() < 1e-4);
/// ```
#[derive(Clone, Debug)]
pub struct SurfaceGeometry {
    positions: Vec<f32>,
    normals: Vec<f32>,
    /// The length of the sum of the faces' normals at each vertex.
    lengths: Vec<f32>,
    around: Around,
}

impl SurfaceGeometry {
    /// The geometry of a closed surface with these faces.
    ///
    /// # Panics
    ///
    /// If a face refers to a vertex without a position.
    pub fn new(faces: &[[u32; 3]], positions: Vec<f32>) -> Self {
        let around = Around::new(faces, positions.len() / 3);
        let mut geometry = Self { positions, normals: Vec::new(), lengths: Vec::new(), around };
        geometry.turn(faces);
        geometry
    }

    /// Positions of the vertices, `[vertices, 3]`.
    pub fn positions(&self) -> &[f32] {
        &self.positions
    }

    /// Unit normals of the vertices, `[vertices, 3]`: the mean of those of the faces around, weighted by area.
    pub fn normals(&self) -> &[f32] {
        &self.normals
    }

    /// The area of the surface.
    pub fn area(&self, faces: &[[u32; 3]]) -> f64 {
        let of_face = |face: &[u32; 3]| {
            let normal = self.normal(face);
            0.5 * f64::from(dot(normal, normal).sqrt())
        };
        faces.iter().map(of_face).sum()
    }

    /// Twice the area of a face, along its normal.
    fn normal(&self, face: &[u32; 3]) -> [f32; 3] {
        let [a, b, c] = *face;
        normal([at(&self.positions, a), at(&self.positions, b), at(&self.positions, c)])
    }

    /// Moves the vertices of the same faces to positions `[vertices, 3]`.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than before.
    pub fn move_to(&mut self, faces: &[[u32; 3]], positions: Vec<f32>) {
        self.positions = positions;
        self.turn(faces);
    }

    /// Recomputes the normals from the positions.
    fn turn(&mut self, faces: &[[u32; 3]]) {
        let of_faces: Vec<[f32; 3]> =
            faces.par_iter().with_min_len(AT_ONCE).map(|face| self.normal(face)).collect();
        let mut sums = self.around.gathered(|corner| of_faces[corner / 3]);
        let unit = |sum: &mut [f32; 3]| {
            let length = dot(*sum, *sum).sqrt().max(LEAST);
            *sum = sum.map(|x| x / length);
            length
        };
        let each = sums.as_chunks_mut().0.par_iter_mut().with_min_len(AT_ONCE);
        self.lengths = each.map(unit).collect();
        self.normals = sums;
    }

    /// The gradient with respect to positions `[vertices, 3]`, given the one with respect to normals `[vertices, 3]`.
    ///
    /// # Panics
    ///
    /// If `upstream` is shorter than the normals.
    pub fn pulled_back(&self, faces: &[[u32; 3]], upstream: &[f32]) -> Vec<f32> {
        // The component along a unit normal has no effect.
        let to_sum = |vertex: usize| {
            let (n, g) = (at(&self.normals, vertex as u32), at(upstream, vertex as u32));
            let along = dot(n, g);
            [0, 1, 2].map(|k| (g[k] - n[k] * along) / self.lengths[vertex])
        };
        let to_sums = self.around.of_vertices(to_sum);
        let of_face = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| at(&self.positions, v));
            let (u, v) = (difference(b, a), difference(c, a));
            let [ga, gb, gc] = face.map(|v| at(&to_sums, v));
            let g = [0, 1, 2].map(|k| ga[k] + gb[k] + gc[k]);
            // Gradient of u × v.
            let (to_b, to_c) = (cross(v, g), cross(g, u));
            [[0, 1, 2].map(|k| -to_b[k] - to_c[k]), to_b, to_c]
        };
        let of_faces: Vec<[[f32; 3]; 3]> =
            faces.par_iter().with_min_len(AT_ONCE).map(of_face).collect();
        self.around.gathered(|corner| of_faces[corner / 3][corner % 3])
    }

    /// The umbrella Laplacian of numbers `[vertices, 3]`: the mean of the neighbours minus the vertex.
    ///
    /// # Panics
    ///
    /// If there are fewer than three numbers per vertex.
    pub fn umbrella(&self, numbers: &[f32]) -> Vec<f32> {
        self.around.of_vertices(|vertex| {
            let around = self.around.ends_at(vertex);
            let mut sum = [0.0; 3];
            for &other in around {
                let other = at(numbers, other);
                (0..3).for_each(|k| sum[k] += other[k]);
            }
            let here = at(numbers, vertex as u32);
            [0, 1, 2].map(|k| sum[k] / around.len() as f32 - here[k])
        })
    }

    /// Curvature at each vertex, `[vertices]`, at least 0, over the unit of length: the root of the summed squares of the differences of
    /// normals along its edges, over that of the lengths. A sphere of radius r has 1 / r. The curvature is then smoothed `times` times, half
    /// the way to the mean of the neighbours.
    pub fn curvatures(&self, times: usize) -> Vec<f32> {
        let curvature = |vertex: usize| {
            let here = [&self.positions, &self.normals].map(|of| at(of, vertex as u32));
            let mut squares = [0.0; 2];
            for &other in self.around.ends_at(vertex) {
                let there = [&self.positions, &self.normals].map(|of| at(of, other));
                for k in 0..2 {
                    let along = difference(there[k], here[k]);
                    squares[k] += dot(along, along);
                }
            }
            [(squares[1] / squares[0].max(LEAST)).sqrt()]
        };
        let mut curvatures = self.around.of_vertices(curvature);
        for _ in 0..times {
            curvatures = self.around.of_vertices(|vertex| {
                let around = self.around.ends_at(vertex);
                let sum: f32 = around.iter().map(|&other| curvatures[other as usize]).sum();
                [0.5 * (curvatures[vertex] + sum / around.len() as f32)]
            });
        }
        curvatures
    }
}

/// Faces and edges around each vertex, as concatenated lists.
#[derive(Clone, Debug)]
struct Around {
    starts: Vec<u32>,
    /// The other end of each edge.
    ends: Vec<u32>,
    /// Three times the face, plus the index of its corner at the vertex.
    corners: Vec<u32>,
}

impl Around {
    fn new(faces: &[[u32; 3]], vertices: usize) -> Self {
        let mut starts = vec![0u32; vertices + 1];
        faces.as_flattened().iter().for_each(|&v| starts[v as usize + 1] += 1);
        (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
        let mut next = starts.clone();
        let (mut ends, mut corners) = (vec![0; 3 * faces.len()], vec![0; 3 * faces.len()]);
        // Each edge of a closed surface leaves each of its ends once.
        for (number, face) in faces.iter().enumerate() {
            for k in 0..3 {
                let place = &mut next[face[k] as usize];
                ends[*place as usize] = face[(k + 1) % 3];
                corners[*place as usize] = (3 * number + k) as u32;
                *place += 1;
            }
        }
        Self { starts, ends, corners }
    }

    /// The other ends of the edges at a vertex.
    #[inline(always)]
    fn ends_at(&self, vertex: usize) -> &[u32] {
        &self.ends[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// Computes N numbers for each vertex.
    fn of_vertices<const N: usize>(&self, of: impl Fn(usize) -> [f32; N] + Sync) -> Vec<f32> {
        let mut all = vec![0.0; N * (self.starts.len() - 1)];
        let each = all.as_chunks_mut().0.par_iter_mut().with_min_len(AT_ONCE).enumerate();
        each.for_each(|(vertex, to)| *to = of(vertex));
        all
    }

    /// Sums over the corners at each vertex, `[vertices, 3]`, in the order of the faces.
    fn gathered(&self, of_corner: impl Fn(usize) -> [f32; 3] + Sync) -> Vec<f32> {
        self.of_vertices(|vertex| {
            let corners = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
            self.corners[corners].iter().fold([0.0; 3], |sum, &corner| {
                let part = of_corner(corner as usize);
                [0, 1, 2].map(|k| sum[k] + part[k])
            })
        })
    }
}

/// The three numbers of a vertex.
#[inline(always)]
fn at(numbers: &[f32], vertex: u32) -> [f32; 3] {
    let start = 3 * vertex as usize;
    [numbers[start], numbers[start + 1], numbers[start + 2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::icosphere;

    fn flat(positions: &[[f64; 3]]) -> Vec<f32> {
        positions.iter().flatten().map(|&x| x as f32).collect()
    }

    #[test]
    fn normals_of_a_sphere_point_outwards() {
        let ball = icosphere(4);
        let geometry = SurfaceGeometry::new(ball.faces(), flat(ball.positions()));
        let pairs = geometry.normals.iter().zip(&geometry.positions);
        assert!(pairs.into_iter().all(|(n, p)| (n - p).abs() < 0.02));
    }

    #[test]
    fn a_gradient_to_normals_comes_to_vertices_as_differences_do() {
        let ball = icosphere(1);
        let mut vertices = flat(ball.positions());
        vertices.iter_mut().enumerate().for_each(|(k, x)| *x += 0.1 * (k as f32 * 2.7).sin());
        let upstream: Vec<f32> = (0..vertices.len()).map(|k| (k as f32 * 1.3).cos()).collect();
        let value = |vertices: &[f32]| -> f64 {
            let geometry = SurfaceGeometry::new(ball.faces(), vertices.to_vec());
            geometry.normals.iter().zip(&upstream).map(|(n, g)| f64::from(n * g)).sum()
        };
        let found = SurfaceGeometry::new(ball.faces(), vertices.clone())
            .pulled_back(ball.faces(), &upstream);
        for k in 0..vertices.len() {
            let moved = |by: f32| {
                let mut vertices = vertices.clone();
                vertices[k] += by;
                value(&vertices)
            };
            let expected = (moved(5e-3) - moved(-5e-3)) / 1e-2;
            assert!((f64::from(found[k]) - expected).abs() < 3e-3, "{} {expected}", found[k]);
        }
    }

    #[test]
    fn curvature_is_one_over_the_radius() {
        let ball = icosphere(4);
        let flat = flat(ball.positions()).iter().map(|x| 0.25 * x).collect();
        for times in [0, 3] {
            let geometry = SurfaceGeometry::new(ball.faces(), Vec::clone(&flat));
            let curvatures = geometry.curvatures(times);
            assert_eq!(curvatures.len(), ball.positions().len());
            let mean = curvatures.iter().sum::<f32>() / curvatures.len() as f32;
            assert!((mean - 4.0).abs() < 0.02, "{mean}");
            // Normals by area are off next to the twelve vertices with five edges.
            assert!(curvatures.iter().all(|c| (c - 4.0).abs() < 0.3));
        }
    }

    #[test]
    fn neighbours_of_an_even_surface_have_their_mean_towards_the_middle() {
        let ball = icosphere(2);
        let geometry = SurfaceGeometry::new(ball.faces(), flat(ball.positions()));
        let away = geometry.umbrella(&geometry.positions);
        for (away, place) in away.chunks(3).zip(geometry.positions.chunks(3)) {
            let inwards = -(0..3).map(|k| away[k] * place[k]).sum::<f32>();
            assert!((0.01..0.1).contains(&inwards), "{inwards}");
        }
    }
}
