//! Texels that a triangle covers.

/// Shows the column and the row of each texel whose middle lies in a triangle, and the shares of the corners there. Corners are in texels; the middle of
/// the first one is (0.5, 0.5). Of triangles side by side one shows a texel on their border, up to rounding.
///
/// ```
/// use softrast_views::covered_texels;
///
/// let mut texels = Vec::new();
/// covered_texels([[0.0, 0.0], [2.2, 0.0], [0.0, 2.2]], |texel, _shares| texels.push(texel));
/// assert_eq!(texels, [[0, 0], [1, 0], [0, 1]]);
/// ```
pub fn covered_texels(corners: [[f64; 2]; 3], mut show: impl FnMut([i64; 2], [f64; 3])) {
    let [a, b, c] = corners;
    let side = |p: [f64; 2], q: [f64; 2], at: [f64; 2]| {
        (q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0])
    };
    let area = side(a, b, c);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    // A border belongs to the triangle that lies to one side of it.
    let owns = |p: [f64; 2], q: [f64; 2]| {
        let [x, y] = [0, 1].map(|k| (q[k] - p[k]) * area.signum());
        y < 0.0 || (y == 0.0 && x > 0.0)
    };
    let edges = [(b, c), (c, a), (a, b)];
    let owned = edges.map(|(p, q)| owns(p, q));
    let range = |k: usize| {
        let of = corners.map(|p| p[k]);
        let [low, high] = [
            of.into_iter().fold(f64::INFINITY, f64::min),
            of.into_iter().fold(f64::NEG_INFINITY, f64::max),
        ];
        (low - 0.5).ceil() as i64..=(high - 0.5).floor() as i64
    };
    for row in range(1) {
        for column in range(0) {
            let at = [column as f64 + 0.5, row as f64 + 0.5];
            let shares = edges.map(|(p, q)| side(p, q, at) / area);
            if (0..3).all(|k| shares[k] > 0.0 || (shares[k] == 0.0 && owned[k])) {
                show([column, row], shares);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_side_by_side_cover_each_texel_once() {
        let square = [[0.5, 0.5], [4.5, 0.5], [4.5, 4.5], [0.5, 4.5]];
        for turned in [false, true] {
            let mut times = [[0; 6]; 6];
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let corners = if turned { [a, c, b] } else { [a, b, c] };
                covered_texels(corners.map(|k: usize| square[k]), |[x, y], shares| {
                    times[y as usize][x as usize] += 1;
                    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                });
            }
            assert!(times.iter().flatten().all(|&count| count <= 1), "{times:?}");
            assert_eq!(times.iter().flatten().sum::<i32>(), 16, "{times:?}");
        }
    }

    #[test]
    fn shares_are_those_of_the_middle() {
        let mut found = Vec::new();
        covered_texels([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]], |at, shares| found.push((at, shares)));
        assert!(found.contains(&([0, 0], [0.5, 0.25, 0.25])), "{found:?}");
        covered_texels([[0.0; 2]; 3], |_, _| panic!("it has no area"));
    }
}
