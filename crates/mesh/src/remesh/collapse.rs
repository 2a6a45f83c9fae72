use super::{
    LONGEST, SHORTEST, THINNEST, are_within, difference, dot,
    half_edges::{HalfEdges, next, previous},
    lengths, normal, place, shape,
};

/// Most edges of a vertex after a collapse.
const MOST_EDGES: u32 = 10;
/// Least cosine of the angle by which a face may turn.
const TURN: f32 = 0.5;

impl HalfEdges {
    /// Collapses each edge that is too short into a vertex, if the surface allows it; returns their number.
    pub(super) fn collapse_short(&mut self, numbers: &mut [f32], width: usize) -> usize {
        let mut marks = vec![0u32; self.of_vertex.len()];
        let (mut mark, mut count) = (0, 0);
        for h in 0..self.from.len() as u32 {
            let [a, b] = [self.from[h as usize], self.from[next(h) as usize]];
            if self.is_dead[h as usize / 3] || a > b {
                continue;
            }
            let [target, length] = lengths(numbers, width, [a, b]);
            if length > SHORTEST * target {
                continue;
            }
            mark += 1;
            if !self.may_become_one(h, &mut marks, mark) {
                continue;
            }
            let middle =
                |k: usize| 0.5 * (place(numbers, width, a)[k] + place(numbers, width, b)[k]);
            let (middle, most) = ([0, 1, 2].map(middle), LONGEST * target);
            let moves = |v: u32| self.may_move(numbers, width, [a, b], v, middle, most);
            if moves(a) && moves(b) {
                self.merge(h, numbers, width);
                count += 1;
            }
        }
        count
    }

    /// Whether the surface stays manifold without the edge of this half-edge: its ends have no common neighbours except the two opposite
    /// vertices, and no vertex ends up with too few or too many edges.
    fn may_become_one(&self, h: u32, marks: &mut [u32], mark: u32) -> bool {
        let t = self.twin[h as usize];
        let [a, b, c, d] = [h, t, previous(h), previous(t)].map(|h| self.from[h as usize]);
        let edges = |v: u32| self.valence[v as usize];
        if c == d || edges(c) <= 3 || edges(d) <= 3 || edges(a) + edges(b) - 4 > MOST_EDGES {
            return false;
        }
        self.around(a).for_each(|g| marks[self.from[next(g) as usize] as usize] = mark);
        let common = |&g: &u32| marks[self.from[next(g) as usize] as usize] == mark;
        self.around(b).filter(common).count() == 2
    }

    /// Whether a vertex may move to a position without turning a face over, except those between `ends`, or an edge above this length.
    fn may_move(
        &self,
        numbers: &[f32],
        width: usize,
        ends: [u32; 2],
        vertex: u32,
        to: [f32; 3],
        most: f32,
    ) -> bool {
        let here = place(numbers, width, vertex);
        self.around(vertex).all(|h| {
            let [p, q] = [next(h), previous(h)].map(|h| self.from[h as usize]);
            if ends.contains(&p) || ends.contains(&q) {
                return true;
            }
            let [p, q] = [p, q].map(|v| place(numbers, width, v));
            let along = difference(p, to);
            let (before, after) = ([here, p, q], [to, p, q]);
            dot(along, along) <= most * most
                && are_within(normal(before), normal(after), TURN)
                && shape(after) > THINNEST.min(shape(before))
        })
    }

    /// Merges the start vertex of the half-edge into its end vertex, at the midpoint.
    fn merge(&mut self, h: u32, numbers: &mut [f32], width: usize) {
        let t = self.twin[h as usize];
        let [a, b, c, d] = [h, t, previous(h), previous(t)].map(|h| self.from[h as usize]);
        let first = self.of_vertex[a as usize];
        let mut g = first;
        loop {
            self.from[g as usize] = b;
            g = self.twin[previous(g) as usize];
            if g == first {
                break;
            }
        }
        let [bc, ca, ad, db] =
            [next(h), previous(h), next(t), previous(t)].map(|h| self.twin[h as usize]);
        self.join(bc, ca);
        self.join(ad, db);
        self.of_vertex[b as usize] = ca;
        self.of_vertex[c as usize] = bc;
        self.of_vertex[d as usize] = ad;
        let both = self.valence[a as usize] + self.valence[b as usize];
        self.valence[b as usize] = both - 4;
        self.valence[c as usize] -= 1;
        self.valence[d as usize] -= 1;
        let [a, b] = [a, b].map(|v| v as usize);
        for k in 0..width {
            numbers[b * width + k] = 0.5 * (numbers[a * width + k] + numbers[b * width + k]);
        }
        self.is_dead[h as usize / 3] = true;
        self.is_dead[t as usize / 3] = true;
        self.is_gone[a] = true;
    }
}
