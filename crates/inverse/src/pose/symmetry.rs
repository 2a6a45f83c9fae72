use softrast_mesh::{
    Mesh,
    vectors::{cross, difference, dot, norm, normal, product},
};
use softrast_views::bounding_ball;

use super::search::{DUPLICATE_IOU, coarse, from_three_sides, overlap};

/// Orders of rotational symmetry that are tried, highest first.
const PARTS: [u32; 5] = [6, 5, 4, 3, 2];
/// Angles that together only a round body has as symmetries, in degrees.
const ANY: [f64; 2] = [10.0, 37.0];
/// Power iterations. Two eigenvectors still mixed after these have nearly equal eigenvalues.
const STEPS: usize = 60;
/// Axes with a larger cosine of their angle are merged.
const SAME_AXIS: f64 = 0.999;

/// A rotation that preserves the silhouettes of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetry {
    /// The axis, of length 1, through the middle of the mesh.
    pub axis: [f64; 3],
    /// The smallest such rotation about it; None if all rotations are symmetries, as for a bottle.
    pub degrees: Option<f64>,
}

/// The axes of rotations that preserve the silhouettes of a mesh from three sides, at low resolution: no mask
/// distinguishes such poses. The candidate axes are the mesh's coordinate axes and its principal axes of inertia.
///
/// ```
/// use softrast_inverse::pose::{Symmetry, symmetries};
/// use softrast_mesh::{fox, icosphere};
///
/// assert!(symmetries(&fox()).is_empty());
/// let ball = symmetries(&icosphere(3));
/// assert!(ball.iter().all(|symmetry: &Symmetry| symmetry.degrees.is_none()) && ball.len() >= 3);
/// ```
pub fn symmetries(mesh: &Mesh) -> Vec<Symmetry> {
    let mesh = &*coarse(mesh);
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut axes = identity.to_vec();
    let (middle, of_inertia) = inertia(mesh);
    let away = |&p: &[f64; 3]| norm(difference(p, middle));
    let radius = mesh.positions().iter().map(away).fold(0.0, f64::max);
    for axis in of_inertia {
        if axes.iter().all(|known| dot(*known, axis).abs() < SAME_AXIS) {
            axes.push(axis);
        }
    }
    let found = axes.into_iter().filter_map(|axis| {
        // The axis comes first, so that the views are along and across it.
        let frame = frame(axis);
        let seen = |rotation| from_three_sides(mesh, (middle, radius), rotation);
        let still = seen(frame);
        let alike = |degrees: f64| {
            let turned = seen(product(frame, turn(axis, degrees.to_radians())));
            overlap(&still, &turned) >= DUPLICATE_IOU
        };
        if ANY.into_iter().all(alike) {
            return Some(Symmetry { axis, degrees: None });
        }
        let degrees = PARTS.map(|parts| 360.0 / f64::from(parts)).into_iter().find(|&by| alike(by));
        degrees.map(|degrees| Symmetry { axis, degrees: Some(degrees) })
    });
    found.collect()
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = norm(a);
    a.map(|x| x / length)
}

/// The rotation by an angle about an axis of length 1 (Rodrigues).
fn turn(axis: [f64; 3], angle: f64) -> [[f64; 3]; 3] {
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = axis;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    [0, 1, 2].map(|i| {
        [0, 1, 2].map(|j| {
            let same = if i == j { cos } else { 0.0 };
            same + sin * skew[i][j] + (1.0 - cos) * axis[i] * axis[j]
        })
    })
}

/// A rotation whose first row is `axis`.
fn frame(axis: [f64; 3]) -> [[f64; 3]; 3] {
    let least = (0..3).min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let second = unit(cross(axis, other));
    [axis, second, cross(axis, second)]
}

/// The centroid of the surface, which lies on every axis of symmetry, and the principal axes of
/// inertia: that of largest extent, that of smallest, and the axis orthogonal to both.
fn inertia(mesh: &Mesh) -> ([f64; 3], Vec<[f64; 3]>) {
    let (near_middle, radius) = bounding_ball(mesh);
    let positions = mesh.positions();
    let place = |p: [f64; 3]| [0, 1, 2].map(|k| (p[k] - near_middle[k]) / radius);
    // The centroid of each face, weighted by area.
    let middles = mesh.faces().iter().map(|face| {
        let [a, b, c] = face.map(|vertex| place(positions[vertex as usize]));
        (norm(normal([a, b, c])), [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0))
    });
    let middles: Vec<(f64, [f64; 3])> = middles.collect();
    let area: f64 = middles.iter().map(|(area, _)| area).sum();
    let mean = [0, 1, 2].map(|k| middles.iter().map(|(w, p)| w * p[k]).sum::<f64>() / area);
    let covariance = [0, 1, 2].map(|i| {
        [0, 1, 2].map(|j| {
            let term = |(w, p): &(f64, [f64; 3])| w * (p[i] - mean[i]) * (p[j] - mean[j]);
            middles.iter().map(term).sum::<f64>() / area
        })
    });
    let trace: f64 = (0..3).map(|k| covariance[k][k]).sum();
    if !(area > 0.0 && trace > 0.0) {
        return (near_middle, Vec::new());
    }
    let middle = [0, 1, 2].map(|k| near_middle[k] + radius * mean[k]);
    let least = |i: usize, j: usize| (if i == j { trace } else { 0.0 }) - covariance[i][j];
    let far = eigenvector(covariance);
    let near = eigenvector([0, 1, 2].map(|i| [0, 1, 2].map(|j| least(i, j))));
    let across = cross(far, near);
    let axes = match dot(across, across) > 0.5 {
        true => vec![far, near, unit(across)],
        false => vec![far],
    };
    (middle, axes)
}

/// The eigenvector of the largest eigenvalue, approximately.
fn eigenvector(matrix: [[f64; 3]; 3]) -> [f64; 3] {
    let mut vector = unit([0.9, 0.7, 0.5]);
    for _ in 0..STEPS {
        vector = unit(matrix.map(|row| dot(row, vector)));
    }
    vector
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lathed profile of radii and heights about an axis.
    fn lathed(profile: &[[f64; 2]], sides: usize, axis: [f64; 3]) -> Mesh {
        let rows = frame(axis);
        let mut positions = Vec::new();
        for [radius, height] in profile {
            for side in 0..sides {
                let angle = std::f64::consts::TAU * side as f64 / sides as f64;
                let local = [*height, radius * angle.cos(), radius * angle.sin()];
                positions.push([0, 1, 2].map(|k| (0..3).map(|j| local[j] * rows[j][k]).sum()));
            }
        }
        let mut faces = Vec::new();
        for ring in 0..profile.len() - 1 {
            for side in 0..sides {
                let next = (side + 1) % sides;
                let at = |ring: usize, side: usize| (ring * sides + side) as u32;
                faces.push([at(ring, side), at(ring, next), at(ring + 1, next)]);
                faces.push([at(ring, side), at(ring + 1, next), at(ring + 1, side)]);
            }
        }
        Mesh::new(positions, faces).unwrap()
    }

    #[test]
    fn a_bottle_is_round_about_its_own_axis_alone() {
        let profile = [[0.0, -1.0], [0.4, -1.0], [0.4, 0.3], [0.12, 0.6], [0.12, 1.0], [0.0, 1.0]];
        let axis = unit([0.3, 0.8, -0.5]);
        let found = symmetries(&lathed(&profile, 48, axis));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].degrees.is_none() && dot(found[0].axis, axis).abs() > 0.999, "{found:?}");
    }

    #[test]
    fn a_square_box_is_turned_by_a_quarter_about_its_long_axis_and_by_a_half_about_others() {
        let profile = [[0.0, -1.0], [0.5, -1.0], [0.5, 1.0], [0.0, 1.0]];
        let found = symmetries(&lathed(&profile, 4, [0.0, 1.0, 0.0]));
        let about = |axis: [f64; 3]| {
            found.iter().find(|found| dot(found.axis, axis).abs() > 0.999).unwrap().degrees
        };
        assert_eq!(about([0.0, 1.0, 0.0]), Some(90.0), "{found:?}");
        assert_eq!(about([1.0, 0.0, 0.0]), Some(180.0), "{found:?}");
    }
}
