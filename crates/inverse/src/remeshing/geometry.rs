//! Normals and neighbours of a surface, over flat lists of three numbers for each vertex.

use rayon::prelude::*;

/// Normals shorter than this, of vertices without a face of some area, stay as they are.
const LEAST: f32 = 1e-30;

/// Unit normals of vertices, the mean of those of the faces around by area, `[vertices, 3]`; and the length of that sum for each vertex.
pub(crate) fn normals(vertices: &[f32], faces: &[[u32; 3]]) -> (Vec<f32>, Vec<f32>) {
    let mut sums = vec![0.0; vertices.len()];
    for face in faces {
        let normal = normal(face.map(|v| at(vertices, v)));
        face.iter().for_each(|&v| add(&mut sums, v, normal));
    }
    let lengths = sums
        .as_chunks_mut::<3>()
        .0
        .iter_mut()
        .map(|sum| {
            let length = dot(*sum, *sum).sqrt().max(LEAST);
            *sum = sum.map(|x| x / length);
            length
        })
        .collect();
    (sums, lengths)
}

/// The gradient to vertices `[vertices, 3]` of one to their [`normals`], which are given with the lengths of their sums.
pub(crate) fn normals_pulled_back(
    vertices: &[f32],
    faces: &[[u32; 3]],
    (normals, lengths): &(Vec<f32>, Vec<f32>),
    upstream: &[f32],
) -> Vec<f32> {
    let triples = |numbers| <[f32]>::as_chunks::<3>(numbers).0.iter();
    let rows = triples(normals).zip(triples(upstream)).zip(lengths);
    // Along a unit normal nothing changes.
    let to_sums: Vec<[f32; 3]> = rows
        .map(|((n, g), length)| {
            let along = dot(*n, *g);
            [0, 1, 2].map(|k| (g[k] - n[k] * along) / length)
        })
        .collect();
    let mut gradient = vec![0.0; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| at(vertices, v));
        let (u, v) = (difference(b, a), difference(c, a));
        let [ga, gb, gc] = face.map(|v| to_sums[v as usize]);
        let g = [0, 1, 2].map(|k| ga[k] + gb[k] + gc[k]);
        // Of u × v.
        let (to_b, to_c) = (cross(v, g), cross(g, u));
        add(&mut gradient, face[1], to_b);
        add(&mut gradient, face[2], to_c);
        add(&mut gradient, face[0], [0, 1, 2].map(|k| -to_b[k] - to_c[k]));
    }
    gradient
}

/// Neighbours of each vertex of a closed surface, in lists one after the other.
pub(crate) struct Neighbours {
    starts: Vec<u32>,
    ends: Vec<u32>,
}

impl Neighbours {
    pub(crate) fn new(faces: &[[u32; 3]], vertices: usize) -> Self {
        let mut starts = vec![0u32; vertices + 1];
        faces.as_flattened().iter().for_each(|&v| starts[v as usize + 1] += 1);
        (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
        let mut next = starts.clone();
        let mut ends = vec![0; 3 * faces.len()];
        // Each edge of a closed surface leaves each of its ends once.
        for face in faces {
            for k in 0..3 {
                let place = &mut next[face[k] as usize];
                ends[*place as usize] = face[(k + 1) % 3];
                *place += 1;
            }
        }
        Self { starts, ends }
    }

    /// How far the mean of the neighbours lies from each vertex, of numbers `[vertices, 3]`.
    pub(crate) fn away(&self, numbers: &[f32]) -> Vec<f32> {
        let mut away = vec![0.0; numbers.len()];
        away.as_chunks_mut::<3>().0.par_iter_mut().with_min_len(AT_ONCE).enumerate().for_each(
            |(vertex, away)| {
                let around =
                    &self.ends[self.starts[vertex] as usize..self.starts[vertex + 1] as usize];
                if around.is_empty() {
                    return;
                }
                let mut sum = [0.0; 3];
                for &other in around {
                    let other = at(numbers, other);
                    (0..3).for_each(|k| sum[k] += other[k]);
                }
                let here = at(numbers, vertex as u32);
                *away = [0, 1, 2].map(|k| sum[k] / around.len() as f32 - here[k]);
            },
        );
        away
    }
}

/// Vertices that one thread takes at once.
const AT_ONCE: usize = 1 << 12;

#[inline(always)]
pub(crate) fn at(numbers: &[f32], vertex: u32) -> [f32; 3] {
    let start = 3 * vertex as usize;
    [numbers[start], numbers[start + 1], numbers[start + 2]]
}

#[inline(always)]
fn add(numbers: &mut [f32], vertex: u32, what: [f32; 3]) {
    let start = 3 * vertex as usize;
    (0..3).for_each(|k| numbers[start + k] += what[k]);
}

#[inline(always)]
fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The area of a face.
pub(crate) fn area(vertices: &[f32], face: [u32; 3]) -> f64 {
    let normal = normal(face.map(|v| at(vertices, v)));
    0.5 * f64::from(dot(normal, normal).sqrt())
}

/// Twice the area of a triangle, along its normal.
#[inline(always)]
fn normal([a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    cross(difference(b, a), difference(c, a))
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    fn flat(positions: &[[f64; 3]]) -> Vec<f32> {
        positions.iter().flatten().map(|&x| x as f32).collect()
    }

    #[test]
    fn normals_of_a_sphere_point_outwards() {
        let ball = icosphere(4);
        let vertices = flat(ball.positions());
        let (found, _) = normals(&vertices, ball.faces());
        assert!(found.iter().zip(&vertices).all(|(n, p)| (n - p).abs() < 0.02));
    }

    #[test]
    fn a_gradient_to_normals_comes_to_vertices_as_differences_do() {
        let ball = icosphere(1);
        let mut vertices = flat(ball.positions());
        vertices.iter_mut().enumerate().for_each(|(k, x)| *x += 0.1 * (k as f32 * 2.7).sin());
        let upstream: Vec<f32> = (0..vertices.len()).map(|k| (k as f32 * 1.3).cos()).collect();
        let value = |vertices: &[f32]| -> f64 {
            let (found, _) = normals(vertices, ball.faces());
            found.iter().zip(&upstream).map(|(n, g)| f64::from(n * g)).sum()
        };
        let found = normals_pulled_back(
            &vertices,
            ball.faces(),
            &normals(&vertices, ball.faces()),
            &upstream,
        );
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
    fn neighbours_of_an_even_surface_have_their_mean_towards_the_middle() {
        let ball = icosphere(2);
        let vertices = flat(ball.positions());
        let away = Neighbours::new(ball.faces(), ball.positions().len()).away(&vertices);
        for (away, place) in away.chunks(3).zip(vertices.chunks(3)) {
            let inwards = -(0..3).map(|k| away[k] * place[k]).sum::<f32>();
            assert!((0.01..0.1).contains(&inwards), "{inwards}");
        }
    }
}
