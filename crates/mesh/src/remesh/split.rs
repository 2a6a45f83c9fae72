use super::{
    LONGEST,
    half_edges::{HalfEdges, next, previous},
    lengths,
};

impl HalfEdges {
    /// Splits each edge that is too long at its midpoint, while there are at most `most` faces; returns their number.
    pub(super) fn split_long(
        &mut self,
        numbers: &mut Vec<f32>,
        width: usize,
        most: usize,
    ) -> usize {
        let mut room = most.saturating_sub(self.is_dead.iter().filter(|dead| !**dead).count());
        let mut count = 0;
        // New half-edges are left for the next pass.
        for h in 0..self.from.len() as u32 {
            let ends @ [a, b] = [self.from[h as usize], self.from[next(h) as usize]];
            if self.is_dead[h as usize / 3] || a > b {
                continue;
            }
            let [target, length] = lengths(numbers, width, ends);
            if length < LONGEST * target {
                continue;
            }
            if room < 2 {
                break;
            }
            self.split(h, numbers, width);
            (room, count) = (room - 2, count + 1);
        }
        count
    }

    /// Inserts a vertex at the midpoint of the edge of a half-edge, and edges from there to both opposite vertices.
    fn split(&mut self, h: u32, numbers: &mut Vec<f32>, width: usize) {
        let t = self.twin[h as usize];
        let [a, b, c, d] = [h, t, previous(h), previous(t)].map(|h| self.from[h as usize]);
        let (hn, hp, tn, tp) = (next(h), previous(h), next(t), previous(t));
        let [bc, ad] = [hn, tn].map(|h| self.twin[h as usize]);
        let v = self.of_vertex.len() as u32;
        for k in 0..width {
            let [x, y] = [a, b].map(|end| numbers[end as usize * width + k]);
            numbers.push(0.5 * (x + y));
        }
        // Face [a, b, c] becomes [a, v, c] and [v, b, c]; face [b, a, d] becomes [b, v, d] and [v, a, d].
        let g = 3 * self.faces() as u32;
        self.is_dead.extend([false; 2]);
        self.from.extend([v, b, c, v, a, d]);
        self.twin.extend([0; 6]);
        self.from[hn as usize] = v;
        self.from[tn as usize] = v;
        for (one, other) in [(h, g + 3), (t, g), (hn, g + 2), (tn, g + 5), (g + 1, bc), (g + 4, ad)]
        {
            self.join(one, other);
        }
        self.of_vertex.push(g);
        self.is_gone.push(false);
        self.valence.push(4);
        for (vertex, begins) in [(a, h), (b, t), (c, hp), (d, tp)] {
            self.of_vertex[vertex as usize] = begins;
        }
        self.valence[c as usize] += 1;
        self.valence[d as usize] += 1;
    }
}
