//! Cuts a polygon into triangles by clipping ears.

use crate::mesh::{cross, difference};

/// Polygons with more corners than this are fanned: clipping takes up to `n³` steps, and a face
/// of thousands of corners is more likely an accident than a concave outline.
const MOST_CORNERS_CLIPPED: usize = 1024;

/// The `n - 2` triangles of a polygon with the `n >= 3` corners `polygon`, in its winding; of each triangle, which of the corners it has.
///
/// The polygon is seen along the axis that shows most of its area. Again and again a convex corner with no other
/// corner in its triangle is cut off, so a concave outline keeps its area; a convex one becomes the
/// fan from its first corner. What has no such corner (crossing itself, no area) is cut anyhow.
pub(crate) fn triangles(positions: &[[f64; 3]], polygon: &[u32]) -> Vec<[usize; 3]> {
    if polygon.len() <= 3 || polygon.len() > MOST_CORNERS_CLIPPED {
        return (2..polygon.len()).map(|i| [0, i - 1, i]).collect();
    }
    let flat = flattened(positions, polygon);
    let mut left: Vec<usize> = (0..polygon.len()).collect();
    let mut cut = Vec::with_capacity(polygon.len() - 2);
    let mut start = 1;
    while left.len() >= 3 {
        let n = left.len();
        let around = |i: usize| [left[(i + n - 1) % n], left[i % n], left[(i + 1) % n]];
        let is_ear = |i: &usize| ear(&flat, &left, around(*i));
        let tip = (start..start + n).find(is_ear).unwrap_or(start) % n;
        cut.push(around(tip));
        left.remove(tip);
        start = tip;
    }
    cut
}

/// The corners in a plane, counterclockwise: seen along the axis that shows most of their area.
fn flattened(positions: &[[f64; 3]], polygon: &[u32]) -> Vec<[f64; 2]> {
    let first = positions[polygon[0] as usize];
    let offsets: Vec<_> =
        polygon.iter().map(|&v| difference(positions[v as usize], first)).collect();
    let normal = offsets.windows(2).fold([0.0; 3], |sum, pair| {
        let part = cross(pair[0], pair[1]);
        [0, 1, 2].map(|k| sum[k] + part[k])
    });
    let axis =
        (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let (i, j) = if normal[axis] < 0.0 { (j, i) } else { (i, j) };
    offsets.iter().map(|p| [p[i], p[j]]).collect()
}

/// Whether `[a, b, c]` turns left and holds none of the corners `left` that lie elsewhere.
fn ear(flat: &[[f64; 2]], left: &[usize], [a, b, c]: [usize; 3]) -> bool {
    let [a, b, c] = [flat[a], flat[b], flat[c]];
    let holds = |p: [f64; 2]| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
    let elsewhere = |p: [f64; 2]| p != a && p != b && p != c;
    turn(a, b, c) > 0.0 && !left.iter().map(|&i| flat[i]).any(|p| elsewhere(p) && holds(p))
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
        let polygon: Vec<_> = (0..outline.len() as u32).collect();
        let faces: Vec<_> =
            triangles(&positions, &polygon).iter().map(|face| face.map(|k| polygon[k])).collect();
        assert_eq!(faces.len(), outline.len() - 2);
        Mesh::new(positions, faces).unwrap()
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

    #[test]
    fn hopeless_polygons_are_cut_all_the_same() {
        cut(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        cut(&[[1.0, 1.0]; 7]);
        cut(&(0..3000).map(|i| [f64::from(i % 7), f64::from(i % 11)]).collect::<Vec<_>>());
    }
}
