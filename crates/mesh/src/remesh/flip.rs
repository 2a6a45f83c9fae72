use super::{
    LONGEST, THINNEST, are_within,
    half_edges::{HalfEdges, next, previous},
    lengths, normal, place, shape,
};

/// Least cosine of the angle between each of two new faces and the sum of the two old ones.
const FLAT: f32 = 0.8;
/// Number of edges per vertex in a regular mesh.
const EDGES: i32 = 6;

impl HalfEdges {
    /// Flips each edge if that brings the valences of its four vertices closer to six and the surface is nearly flat; returns their number.
    pub(super) fn flip(&mut self, numbers: &[f32], width: usize) -> usize {
        let mut count = 0;
        for h in 0..self.from.len() as u32 {
            let t = self.twin[h as usize];
            if self.is_dead[h as usize / 3] || t < h {
                continue;
            }
            let vertices = [h, t, previous(h), previous(t)].map(|h| self.from[h as usize]);
            if self.is_evened_by_flip(vertices) && self.may_flip(numbers, width, vertices) {
                self.flip_one(h);
                count += 1;
            }
        }
        count
    }

    fn is_evened_by_flip(&self, [a, b, c, d]: [u32; 4]) -> bool {
        let edges = |v: u32| self.valence[v as usize] as i32;
        if edges(a) <= 3 || edges(b) <= 3 || c == d {
            return false;
        }
        let off = |v: u32, change: i32| (edges(v) + change - EDGES).abs();
        off(a, -1) + off(b, -1) + off(c, 1) + off(d, 1)
            < off(a, 0) + off(b, 0) + off(c, 0) + off(d, 0)
    }

    fn may_flip(&self, numbers: &[f32], width: usize, [a, b, c, d]: [u32; 4]) -> bool {
        let corners = |face: [u32; 3]| face.map(|v| place(numbers, width, v));
        let [before, after] =
            [[[a, b, c], [b, a, d]], [[a, d, c], [b, c, d]]].map(|faces| faces.map(corners));
        let [first, second] = before.map(normal);
        let both = [0, 1, 2].map(|k| first[k] + second[k]);
        let thinnest = THINNEST.min(shape(before[0])).min(shape(before[1]));
        let fits = |face| are_within(normal(face), both, FLAT) && shape(face) > thinnest;
        let [target, length] = lengths(numbers, width, [c, d]);
        length < LONGEST * target
            && after.into_iter().all(fits)
            && !self.around(c).any(|g| self.from[next(g) as usize] == d)
    }

    /// Flips the edge of a half-edge to join the two opposite vertices.
    fn flip_one(&mut self, h: u32) {
        let t = self.twin[h as usize];
        let (hn, hp, tn, tp) = (next(h), previous(h), next(t), previous(t));
        let [a, b, c, d] = [h, t, hp, tp].map(|h| self.from[h as usize]);
        let [bc, ca, ad, db] = [hn, hp, tn, tp].map(|h| self.twin[h as usize]);
        for (half_edge, vertex) in [(h, d), (hn, c), (hp, a), (t, c), (tn, d), (tp, b)] {
            self.from[half_edge as usize] = vertex;
        }
        for (one, other) in [(hn, ca), (hp, ad), (tn, db), (tp, bc)] {
            self.join(one, other);
        }
        for (vertex, begins) in [(a, hp), (b, tp), (c, hn), (d, tn)] {
            self.of_vertex[vertex as usize] = begins;
        }
        for (vertex, change) in [(a, -1), (b, -1), (c, 1), (d, 1)] {
            let edges = &mut self.valence[vertex as usize];
            *edges = edges.wrapping_add_signed(change);
        }
    }
}
