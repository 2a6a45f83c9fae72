use std::collections::{BTreeMap, BTreeSet};

use crate::Mesh;

impl Mesh {
    /// The shape with fewer faces: all vertices in a cube of a grid are merged into one, at their mean.
    ///
    /// `cell` is the side of a cube in world units; no vertex moves by more than its diagonal. Faces that shrink to an edge or a point are
    /// removed, and only the first of several faces between the same three vertices is kept, so walls thinner than a cube become one sheet.
    /// Colours are averaged too, a texture is removed. `None` if no face remains.
    ///
    /// Source: vertex clustering, Rossignac and Borrel 1993.
    #[must_use]
    pub fn clustered(&self, cell: f64) -> Option<Self> {
        let mut sums: Vec<([[f64; 3]; 2], f64)> = Vec::new();
        let mut numbers = BTreeMap::new();
        let mut merged = vec![None; self.positions().len()];
        let mut seen = BTreeSet::new();
        let mut faces = Vec::new();
        for face in self.faces() {
            let corners = face.map(|v| {
                *merged[v as usize].get_or_insert_with(|| {
                    let position = self.positions()[v as usize];
                    let number = *numbers
                        .entry(position.map(|x| (x / cell).floor() as i64))
                        .or_insert_with(|| {
                            sums.push(([[0.0; 3]; 2], 0.0));
                            sums.len() - 1
                        });
                    let colour = self.colours().map_or([0.0; 3], |colours| colours[v as usize]);
                    let ([place, paint], count) = &mut sums[number];
                    *place = [0, 1, 2].map(|k| place[k] + position[k]);
                    *paint = [0, 1, 2].map(|k| paint[k] + colour[k]);
                    *count += 1.0;
                    number as u32
                })
            });
            let mut sorted = corners;
            sorted.sort_unstable();
            let has_area = sorted[0] != sorted[1] && sorted[1] != sorted[2];
            if has_area && seen.insert(sorted) {
                faces.push(corners);
            }
        }
        if faces.is_empty() {
            return None;
        }
        let means = |part: usize| -> Vec<[f64; 3]> {
            sums.iter().map(|(sum, count)| sum[part].map(|x| x / count)).collect()
        };
        let mesh = Self::from_valid(means(0), faces);
        Some(match self.colours() {
            // Rounding may exceed the largest of them slightly.
            Some(_) => mesh.painted(means(1).into_iter().map(|c| c.map(|x| x.min(1.0))).collect()),
            None => mesh,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::{Mesh, icosphere};

    #[test]
    fn a_ball_of_many_faces_becomes_one_of_few() {
        let ball = icosphere(5);
        let few = ball.clustered(0.25).unwrap();
        assert!(few.faces().len() < ball.faces().len() / 10, "{} faces", few.faces().len());
        assert!((few.area() / ball.area() - 1.0).abs() < 0.05, "area {}", few.area());
        let radius = |p: &[f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(few.positions().iter().all(|p| (radius(p) - 1.0).abs() < 0.02));
    }

    #[test]
    fn both_sides_of_a_thin_wall_become_one_sheet() {
        let corners = [[0.1, 0.1], [3.1, 0.1], [0.1, 3.1]];
        let side = |z: f64| corners.map(|[x, y]| [x, y, z]);
        let wall = Mesh::new([side(0.2), side(0.4)].concat(), vec![[0, 1, 2], [3, 5, 4]]).unwrap();
        let sheet = wall.clustered(1.0).unwrap();
        assert_eq!(sheet.faces(), &[[0, 1, 2]]);
        assert!(sheet.positions().iter().all(|p| (p[2] - 0.3).abs() < 1e-12));
    }

    #[test]
    fn colours_of_merged_vertices_are_means() {
        let corners = vec![[0.1; 3], [0.2; 3], [3.1, 0.1, 0.1], [0.1, 3.1, 0.1]];
        let mesh = Mesh::new(corners, vec![[0, 2, 3], [1, 2, 3]]).unwrap();
        let mesh = mesh.with_colours(vec![[0.0; 3], [1.0; 3], [0.25; 3], [1.0; 3]]).unwrap();
        let few = mesh.clustered(1.0).unwrap();
        assert_eq!(few.colours().unwrap(), [[0.5; 3], [0.25; 3], [1.0; 3]]);
    }

    #[test]
    fn nothing_is_left_in_a_cube_larger_than_the_mesh() {
        let wall =
            Mesh::new(vec![[0.1; 3], [0.2, 0.1, 0.1], [0.1, 0.2, 0.1]], vec![[0, 1, 2]]).unwrap();
        assert!(wall.clustered(1.0).is_none());
    }
}
