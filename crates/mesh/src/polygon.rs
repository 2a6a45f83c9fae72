//! Triangulates polygons by ear clipping.

use std::collections::VecDeque;

use crate::{
    error::Trouble,
    vectors::{cross, difference},
};

/// Limits of box tests for all polygons of a file together, per corner and in addition to that. Simple outlines take up to about 60 per
/// corner; a malicious file of quadratic cost would keep programs busy for hours.
const LOOKS_PER_CORNER: u64 = 100;
const LOOKS: u64 = 20_000_000;

/// Number of full searches for new ears when a polygon has run out of them. A simple polygon never runs out.
const SEARCHES: usize = 16;

/// Corners in one leaf of the tree of boxes.
const LEAF: usize = 8;

/// The polygons of a file, concatenated.
#[derive(Default)]
pub(crate) struct Polygons {
    /// The vertices of all corners.
    pub(crate) corners: Vec<u32>,
    /// Number of corners of each polygon, at least three.
    pub(crate) arities: Vec<u32>,
}

impl Polygons {
    /// The triangles between vertices, from triangles between [`Polygons::cut`] corners.
    pub(crate) fn faces(&self, cut: &[[u32; 3]]) -> Vec<[u32; 3]> {
        cut.iter().map(|triangle| triangle.map(|k| self.corners[k as usize])).collect()
    }

    /// The `n - 2` triangles of each polygon of `n` corners, in its winding; all corners of the file are numbered in order.
    ///
    /// A polygon is projected along the axis that shows most of its area. Convex corners with no other corner in their triangle are clipped
    /// repeatedly, so a concave outline keeps its area; a convex one becomes the fan from its first corner. Outlines without such a corner
    /// (self-intersecting, no area) are cut anyway. `n` corners take about `n log n` steps.
    pub(crate) fn cut(&self, positions: &[[f64; 3]]) -> Result<Vec<[u32; 3]>, Trouble> {
        u32::try_from(self.corners.len())
            .map_err(|_| Trouble::part("faces", "more corners than 32 bits can number"))?;
        let mut looks = LOOKS + LOOKS_PER_CORNER * self.corners.len() as u64;
        let mut cut = Vec::with_capacity(self.corners.len().saturating_sub(2 * self.arities.len()));
        let mut start = 0;
        for (number, &arity) in self.arities.iter().enumerate() {
            let end = start + arity;
            let polygon = &self.corners[start as usize..end as usize];
            let mut add = |triangle: [u32; 3]| cut.push(triangle.map(|k| start + k));
            if polygon.len() == 3 {
                add([0, 1, 2]);
            } else if !Outline::new(positions, polygon).clip(&mut looks, add) {
                let reason = format!(
                    "it has {} corners, and it or polygons before it cross themselves too often: export the mesh with triangles",
                    polygon.len()
                );
                return Err(Trouble::part(format!("polygon {number}"), reason));
            }
            start = end;
        }
        Ok(cut)
    }
}

/// A polygon during triangulation.
struct Outline {
    /// The corners in a plane, counterclockwise.
    flat: Vec<[f64; 2]>,
    before: Vec<u32>,
    /// The next corner; the corner itself once it is clipped.
    next: Vec<u32>,
    blockers: Blockers,
}

impl Outline {
    fn new(positions: &[[f64; 3]], polygon: &[u32]) -> Self {
        let last = polygon.len() as u32 - 1;
        let mut outline = Self {
            flat: flattened(positions, polygon),
            before: (0..=last).map(|k| if k == 0 { last } else { k - 1 }).collect(),
            next: (0..=last).map(|k| if k == last { 0 } else { k + 1 }).collect(),
            blockers: Blockers::default(),
        };
        let blockers = (0..=last).filter(|&k| !outline.turns_left(k)).collect();
        outline.blockers = Blockers::new(&outline.flat, blockers);
        outline
    }

    /// Passes all triangles to `add`; returns false if that takes more than `looks`.
    fn clip(&mut self, looks: &mut u64, mut add: impl FnMut([u32; 3])) -> bool {
        let n = self.next.len() as u32;
        if self.blockers.are_none() {
            (2..n).for_each(|k| add([0, k - 1, k]));
            return true;
        }
        let mut waiting: VecDeque<u32> = (1..n).chain([0]).collect();
        let (mut here, mut searches) = (1, SEARCHES);
        for left in (4..=n).rev() {
            let next = std::iter::from_fn(|| waiting.pop_front());
            let mut next = next.filter(|&k| self.next[k as usize] != k);
            let found = next.find(|&k| self.is_ear(k, looks));
            if *looks == 0 {
                return false;
            }
            let tip = found.unwrap_or(here);
            let [a, _, c] = self.around(tip);
            add([a, tip, c]);
            (self.next[a as usize], self.before[c as usize]) = (c, a);
            self.next[tip as usize] = tip;
            self.blockers.remove(tip);
            for k in [a, c] {
                if self.turns_left(k) {
                    self.blockers.remove(k);
                }
            }
            // The state of other corners as ears is unchanged, as long as the outline is simple.
            waiting.push_front(c);
            waiting.push_back(a);
            here = c;
            if found.is_none() && searches > 0 {
                searches -= 1;
                let mut k = c;
                for _ in 2..left {
                    k = self.next[k as usize];
                    waiting.push_back(k);
                }
            }
        }
        add(self.around(here));
        true
    }

    fn around(&self, k: u32) -> [u32; 3] {
        [self.before[k as usize], k, self.next[k as usize]]
    }

    fn triangle(&self, k: u32) -> [[f64; 2]; 3] {
        self.around(k).map(|k| self.flat[k as usize])
    }

    fn turns_left(&self, k: u32) -> bool {
        let [a, b, c] = self.triangle(k);
        turn(a, b, c) > 0.0
    }

    /// Whether the triangle at a corner turns left and contains no blocking corner at another position.
    fn is_ear(&self, k: u32, looks: &mut u64) -> bool {
        self.turns_left(k) && !self.blockers.meet(&self.triangle(k), looks)
    }
}

/// The remaining corners that turn right or not at all: in a simple outline, a triangle that contains any corner contains one of these. No
/// corner becomes one later.
#[derive(Default)]
struct Blockers {
    /// Their positions, near ones next to each other; NaN once they are clipped.
    points: Vec<[f64; 2]>,
    /// The number in `points` of each corner of the polygon, or `NOWHERE`.
    slots: Vec<u32>,
    /// A tree: the box of node `i` holds those of nodes `2 i` and `2 i + 1`, and that of a leaf `LEAF` of the points.
    boxes: Vec<[[f64; 2]; 2]>,
}

const NOWHERE: u32 = u32::MAX;

impl Blockers {
    fn new(flat: &[[f64; 2]], mut corners: Vec<u32>) -> Self {
        if corners.is_empty() {
            return Self::default();
        }
        let [low, high] = around_all(flat.iter().map(|&p| [p; 2]));
        let cells = |k: usize| f64::from(u16::MAX) / (high[k] - low[k]).max(f64::MIN_POSITIVE);
        let scale = [cells(0), cells(1)];
        corners.sort_by_cached_key(|&corner| {
            let p = flat[corner as usize];
            let [x, y] = [0, 1].map(|k| ((p[k] - low[k]) * scale[k]) as u16);
            spread(x) | spread(y) << 1
        });
        let points: Vec<_> = corners.iter().map(|&corner| flat[corner as usize]).collect();
        let mut slots = vec![NOWHERE; flat.len()];
        for (slot, &corner) in corners.iter().enumerate() {
            slots[corner as usize] = slot as u32;
        }
        let leaves = points.len().div_ceil(LEAF);
        let first = leaves.next_power_of_two();
        let mut blockers = Self { points, slots, boxes: vec![EMPTY; 2 * first] };
        for leaf in 0..leaves {
            blockers.boxes[first + leaf] = around_all(blockers.leaf(leaf).map(|p| [p; 2]));
        }
        for node in (1..first).rev() {
            blockers.boxes[node] = blockers.around_both(node);
        }
        blockers
    }

    fn are_none(&self) -> bool {
        self.points.is_empty()
    }

    fn leaf(&self, leaf: usize) -> impl Iterator<Item = [f64; 2]> {
        let end = self.points.len().min((leaf + 1) * LEAF);
        self.points[(leaf * LEAF).min(end)..end].iter().copied()
    }

    fn around_both(&self, node: usize) -> [[f64; 2]; 2] {
        around_all([self.boxes[2 * node], self.boxes[2 * node + 1]])
    }

    fn remove(&mut self, corner: u32) {
        let Some(&slot) = self.slots.get(corner as usize).filter(|&&slot| slot != NOWHERE) else {
            return;
        };
        let slot = slot as usize;
        self.slots[corner as usize] = NOWHERE;
        self.points[slot] = [f64::NAN; 2];
        let mut node = self.boxes.len() / 2 + slot / LEAF;
        let mut found = around_all(self.leaf(slot / LEAF).map(|p| [p; 2]));
        while std::mem::replace(&mut self.boxes[node], found) != found && node > 1 {
            node /= 2;
            found = self.around_both(node);
        }
    }

    /// Whether a blocker lies in `triangle`, and at none of its corners.
    fn meet(&self, triangle: &[[f64; 2]; 3], looks: &mut u64) -> bool {
        let leaves = self.boxes.len() / 2;
        // One node per level, and its sibling.
        let (mut waiting, mut count) = ([1; 64], 1);
        while count > 0 && *looks > 0 {
            *looks -= 1;
            count -= 1;
            let node: usize = waiting[count];
            if !meets(&self.boxes[node], triangle) {
                continue;
            }
            if node < leaves {
                waiting[count] = 2 * node + 1;
                waiting[count + 1] = 2 * node;
                count += 2;
            } else if self.leaf(node - leaves).any(|p| is_in(p, triangle) && !triangle.contains(&p))
            {
                return true;
            }
        }
        false
    }
}

/// The bits of `x` with a zero before each.
fn spread(x: u16) -> u32 {
    [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)]
        .iter()
        .fold(u32::from(x), |x, (by, mask)| (x | x << by) & mask)
}

/// Lowest and highest corner of a box around nothing.
const EMPTY: [[f64; 2]; 2] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];

fn around_all(boxes: impl IntoIterator<Item = [[f64; 2]; 2]>) -> [[f64; 2]; 2] {
    boxes.into_iter().fold(EMPTY, |[low, high], [l, h]| {
        [[low[0].min(l[0]), low[1].min(l[1])], [high[0].max(h[0]), high[1].max(h[1])]]
    })
}

/// Whether a box may have a point in a triangle, with the same rounding: no false negatives.
fn meets(&[low, high]: &[[f64; 2]; 2], triangle: &[[f64; 2]; 3]) -> bool {
    let [[a, b, c], [d, e, f]] = [0, 1].map(|k| triangle.map(|p| p[k]));
    if low[0] > a.max(b).max(c)
        || high[0] < a.min(b).min(c)
        || low[1] > d.max(e).max(f)
        || high[1] < d.min(e).min(f)
    {
        return false;
    }
    let [a, b, c] = *triangle;
    [[a, b], [b, c], [c, a]].iter().all(|&[from, to]| {
        // The corner of the box that is farthest to the left of the edge.
        let x = if to[1] > from[1] { low[0] } else { high[0] };
        let y = if to[0] > from[0] { high[1] } else { low[1] };
        turn(from, to, [x, y]) >= 0.0
    })
}

fn is_in(p: [f64; 2], &[a, b, c]: &[[f64; 2]; 3]) -> bool {
    turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

/// The corners in a plane, counterclockwise: projected along the axis that shows most of their area.
fn flattened(positions: &[[f64; 3]], polygon: &[u32]) -> Vec<[f64; 2]> {
    let first = positions[polygon[0] as usize];
    let offset = |v: u32| difference(positions[v as usize], first);
    let normal = polygon.windows(2).fold([0.0; 3], |sum, pair| {
        let part = cross(offset(pair[0]), offset(pair[1]));
        [0, 1, 2].map(|k| sum[k] + part[k])
    });
    let axis =
        (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let (i, j) = if normal[axis] < 0.0 { (j, i) } else { (i, j) };
    polygon.iter().map(|&v| [offset(v)[i], offset(v)[j]]).collect()
}

/// Twice the area of a triangle in the plane, positive if it is counterclockwise.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;

    /// The polygon with these corners in the plane, lifted onto x = 2y.
    fn cut(outline: &[[f64; 2]]) -> Mesh {
        let positions: Vec<_> = outline.iter().map(|&[y, z]| [2.0 * y, y, z]).collect();
        let n = outline.len() as u32;
        let polygons = Polygons { corners: (0..n).collect(), arities: vec![n] };
        let Ok(faces) = polygons.cut(&positions) else { panic!("{} corners", outline.len()) };
        assert_eq!(faces.len(), outline.len() - 2);
        Mesh::new(positions, faces).unwrap()
    }

    /// The area of a simple outline.
    fn area(outline: &[[f64; 2]]) -> f64 {
        let next = outline.iter().cycle().skip(1);
        outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>().abs() / 2.0
    }

    #[test]
    fn convex_polygon_becomes_a_fan() {
        let pentagon = [[0.0, 0.0], [2.0, 0.0], [3.0, 1.0], [1.0, 3.0], [-1.0, 1.0]];
        assert_eq!(cut(&pentagon).faces(), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn concave_polygon_keeps_its_area_from_any_first_corner_and_either_side() {
        // A comb of three teeth, each of area 1.5, on a 5 by 1 bar.
        let mut comb = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 2.5],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 4.0],
            [2.0, 4.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [0.0, 2.5],
        ];
        for turned in 0..20 {
            comb.rotate_left(1);
            if turned == 10 {
                comb.reverse();
            }
            let area = cut(&comb).area() / 5f64.sqrt();
            assert!((area - 9.5).abs() < 1e-12, "area {area} after {turned} turns");
        }
    }

    /// Simple outlines of about `n` corners.
    fn outlines(n: u32) -> Vec<(&'static str, Vec<[f64; 2]>)> {
        let circle = |radius: &dyn Fn(u32) -> f64| -> Vec<[f64; 2]> {
            let at = |k: u32| f64::from(k) * std::f64::consts::TAU / f64::from(n);
            (0..n).map(|k| [radius(k) * at(k).cos(), radius(k) * at(k).sin()]).collect()
        };
        let noise = |k: u32| f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
        let comb = (0..n / 2).map(|k| [f64::from(k), f64::from(k % 2) * 100.0]);
        let back = (0..n / 2).rev().map(|k| [f64::from(k), f64::from(k % 2) * 100.0 - 1.0]);
        let turn = |k: u32| f64::from(k) * 0.1;
        let arm =
            |k: u32, out: f64| [(turn(k) + out) * turn(k).cos(), (turn(k) + out) * turn(k).sin()];
        let spiral = (0..n / 2).map(|k| arm(k, 1.0)).chain((0..n / 2).rev().map(|k| arm(k, 3.0)));
        let far = |k: u32| f64::from(k) / f64::from(n);
        let bow = |k: u32, bend: f64| [far(k), far(k) + bend * far(k) * (0.5 - far(k))];
        let sliver = (0..n / 2).map(|k| bow(k, 1e-4)).chain((1..n / 2).rev().map(|k| bow(k, 3e-4)));
        vec![
            ("gear", circle(&|k| if k % 4 < 2 { 1.0 } else { 0.9 })),
            ("noise", circle(&|k| 1.0 + 0.5 * noise(k))),
            ("star", circle(&|k| if k % 2 == 0 { 1.0 } else { 0.01 })),
            ("notch", circle(&|k| if k == n / 3 { 0.1 } else { 1.0 })),
            ("zigzag", comb.chain(back).collect()),
            ("spiral", spiral.collect()),
            ("sliver", sliver.collect()),
        ]
    }

    #[test]
    fn large_outlines_keep_their_area() {
        for n in [200, 20_000] {
            for (name, outline) in outlines(n) {
                for first in [0, n / 3] {
                    let mut outline = outline.clone();
                    outline.rotate_left(first as usize);
                    let found = cut(&outline).area() / 5f64.sqrt();
                    assert!((found / area(&outline) - 1.0).abs() < 1e-9, "{name} of {n}: {found}");
                }
            }
        }
    }

    #[test]
    fn hopeless_polygons_are_cut_all_the_same() {
        cut(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        cut(&[[1.0, 1.0]; 7]);
        cut(&(0..3000).map(|i| [f64::from(i % 7), f64::from(i % 11)]).collect::<Vec<_>>());
    }

    #[test]
    fn polygons_that_would_take_the_square_of_their_length_are_one_line() {
        let place = |k: u32| [0.0, f64::from(k * k % 1009), f64::from(k * k * k % 997)];
        let positions: Vec<_> = (0..500).map(place).collect();
        let polygon = |by: u32| (0..50_000).map(move |k| (k * (k + by) + k / 500) % 500);
        let corners = (0..10).flat_map(polygon).collect();
        let polygons = Polygons { corners, arities: vec![50_000; 10] };
        let message = polygons.cut(&positions).err().unwrap().of_file("a.obj").to_string();
        let expected = "cross themselves too often: export the mesh with triangles";
        assert!(message.starts_with("a.obj: polygon ") && message.ends_with(expected), "{message}");
    }
}
