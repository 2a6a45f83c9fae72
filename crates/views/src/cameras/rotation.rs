use anyhow::{bail, ensure};
use softrast_mesh::vectors::rotation;

/// Largest deviation of entries of `R Rᵀ` from the identity: numbers with three decimals deviate by a fifth of it.
const MOST_OFF: f64 = 1e-2;
/// Deviation above which a note on rounding is printed: that of numbers in f32, or with five decimals or more, is lower.
pub(crate) const SAID: f64 = 5e-5;
/// A matrix that is closer to a rotation is unchanged.
const EXACT: f64 = 1e-9;
/// Each step squares the remaining deviation.
const STEPS: usize = 6;

/// The rotation nearest to R, and the largest deviation of `R Rᵀ` from the identity: files hold few digits.
///
/// A reflection becomes the nearest reflection.
///
/// # Errors
///
/// If the deviation is at least 0.01.
pub(crate) fn nearest(r: [[f64; 3]; 3]) -> anyhow::Result<([[f64; 3]; 3], f64)> {
    ensure!(r.as_flattened().iter().all(|x| x.is_finite()), "R has a number that is not finite");
    let product = product(&r);
    let off = off(&product, 1.0);
    if off >= MOST_OFF || off.is_nan() {
        let square = (product[0][0] + product[1][1] + product[2][2]) / 3.0;
        let scaled = square > 0.0 && square.is_finite();
        if scaled && self::off(&product, square) / square < MOST_OFF {
            bail!(
                "R is a rotation times {:.5}, and a camera has no scale: divide the nine numbers of R by that, and t where a point is seen at \
                 R p + t",
                square.sqrt()
            );
        }
        bail!(
            "R is no rotation: R Rᵀ is off the identity by {off:.2e}, and 0.01 is too much: write its numbers with more digits, or take the \
             nearest rotation (as scipy's Rotation.from_matrix does)"
        );
    }
    if off < EXACT {
        return Ok((r, off));
    }
    // The polar decomposition by Newton's method: the mean of X and its inverse transpose.
    let polar = (0..STEPS).fold(r, |x, _| {
        let (inverse, determinant) = cofactors(&x);
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (x[i][j] + inverse[i][j] / determinant)))
    });
    Ok((polar, off))
}

/// The rotation of a quaternion `w + x i + y j + z k` of any length but 0.
///
/// # Errors
///
/// If it has no direction.
pub(crate) fn of_quaternion(quaternion: [f64; 4]) -> anyhow::Result<[[f64; 3]; 3]> {
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    ensure!(
        length.is_normal() && length.recip().is_normal(),
        "the quaternion {quaternion:?} has no direction"
    );
    Ok(rotation(quaternion.map(|number| number / length)))
}

/// The quaternion `w + x i + y j + z k` of a rotation, of length 1 and with w at least 0.
pub(super) fn to_quaternion(r: &[[f64; 3]; 3]) -> [f64; 4] {
    // Four times the squares of the components: the largest is far from 0; the others follow from off-diagonal sums and differences.
    let trace = r[0][0] + r[1][1] + r[2][2];
    let squares = [
        1.0 + trace,
        1.0 - trace + 2.0 * r[0][0],
        1.0 - trace + 2.0 * r[1][1],
        1.0 - trace + 2.0 * r[2][2],
    ];
    let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let [x, y, z] = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
    let [xy, xz, yz] = [r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]];
    let products = match largest {
        0 => [squares[0], x, y, z],
        1 => [x, squares[1], xy, xz],
        2 => [y, xy, squares[2], yz],
        _ => [z, xz, yz, squares[3]],
    };
    let length = products.iter().map(|x| x * x).sum::<f64>().sqrt();
    products.map(|x| if products[0] < 0.0 { -x } else { x } / length)
}

fn off(product: &[[f64; 3]; 3], diagonal: f64) -> f64 {
    let places = (0..9).map(|k| (k / 3, k % 3));
    let off = |(i, j): (usize, usize)| (product[i][j] - if i == j { diagonal } else { 0.0 }).abs();
    places.map(off).fold(0.0, f64::max)
}

/// R Rᵀ.
fn product(r: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| r[i][k] * r[j][k]).sum()))
}

/// The inverse transpose times the determinant, and the determinant.
fn cofactors(x: &[[f64; 3]; 3]) -> ([[f64; 3]; 3], f64) {
    let next = [1, 2, 0];
    let of = |i: usize, j: usize| {
        let ([a, b], [c, d]) = ([next[i], next[next[i]]], [next[j], next[next[j]]]);
        x[a][c] * x[b][d] - x[a][d] * x[b][c]
    };
    let cofactors = [0, 1, 2].map(|i| [0, 1, 2].map(|j| of(i, j)));
    let determinant = (0..3).map(|j| x[0][j] * cofactors[0][j]).sum();
    (cofactors, determinant)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation(a: f64, b: f64) -> [[f64; 3]; 3] {
        let ((sa, ca), (sb, cb)) = (a.sin_cos(), b.sin_cos());
        [[ca, -sa * cb, sa * sb], [sa, ca * cb, -ca * sb], [0.0, sb, cb]]
    }

    #[test]
    fn a_rotation_comes_back_from_its_quaternion() {
        for k in 0..400 {
            // Including half turns about the axes.
            let (a, b) = (
                (k % 20) as f64 * 0.1 * std::f64::consts::PI,
                (k / 20) as f64 * 0.1 * std::f64::consts::PI,
            );
            let r = rotation(a, b);
            let quaternion = to_quaternion(&r);
            let back = of_quaternion(quaternion).unwrap();
            let pairs = back.as_flattened().iter().zip(r.as_flattened());
            assert!(pairs.into_iter().all(|(x, y)| (x - y).abs() < 1e-12), "{quaternion:?}");
            assert!(quaternion[0] >= 0.0);
        }
        assert_eq!(of_quaternion([0.0; 4]).unwrap_err().to_string().lines().count(), 1);
    }

    fn changed(r: [[f64; 3]; 3], change: impl Fn(f64) -> f64) -> [[f64; 3]; 3] {
        r.map(|row| row.map(&change))
    }

    #[test]
    fn a_rotation_of_three_decimals_becomes_the_rotation_that_it_was() {
        for k in 0..50 {
            let exact = rotation(0.37 * f64::from(k), 0.61 * f64::from(k) - 4.0);
            let (found, off) = nearest(changed(exact, |x| (1e3 * x).round() / 1e3)).unwrap();
            assert!(off < 2e-3, "{off}");
            assert!(super::off(&product(&found), 1.0) < 1e-14, "{found:?}");
            let apart = exact.as_flattened().iter().zip(found.as_flattened());
            assert!(apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 8e-4);
            assert_eq!(nearest(exact).unwrap().0, exact);
        }
    }

    #[test]
    fn the_nearest_rotation_treats_all_axes_alike() {
        // A small symmetric stretch of a rotation is undone, for any order of its axes.
        let exact = rotation(0.8, -0.3);
        let stretch = [[1.002, 1e-3, 0.0], [1e-3, 0.998, -5e-4], [0.0, -5e-4, 1.001]];
        let stretched = [0, 1, 2]
            .map(|i| [0, 1, 2].map(|j| (0..3).map(|k| stretch[i][k] * exact[k][j]).sum::<f64>()));
        let (found, _) = nearest(stretched).unwrap();
        let apart = exact.as_flattened().iter().zip(found.as_flattened());
        assert!(apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-12, "{found:?}");
    }

    #[test]
    fn what_is_off_by_a_hundredth_is_refused_with_what_to_do() {
        let exact = rotation(0.8, -0.3);
        for scale in [2.0, 1.01, 0.99, 1e-3, 1e3] {
            let error = nearest(changed(exact, |x| scale * x)).unwrap_err().to_string();
            let expected = format!("a rotation times {scale:.5}");
            assert!(error.contains(&expected) && error.contains("divide"), "{error}");
        }
        let mut sheared = exact;
        sheared[0][0] += 0.02;
        let error = nearest(sheared).unwrap_err().to_string();
        assert!(error.contains("no rotation") && error.contains("more digits"), "{error}");
        for wrong in [[[0.0; 3]; 3], [[1e300; 3]; 3], [[f64::NAN; 3]; 3]] {
            let error = nearest(wrong).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        // A reflection stays one, and the camera refuses it.
        let (mirror, _) = nearest(changed(exact, |x| -x)).unwrap();
        assert_eq!(mirror, changed(exact, |x| -x));
    }
}
