//! Culling satisfies its bound, and results do not depend on the order of faces.

use std::sync::Arc;

use softrast_raster::{SoftRenderer, TConorm, low_level::Rasterizer, reference};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::NdArray;
use softrast_tests::{ToleranceCase, numbers, vector};

use super::triangles::triangles;

type B = NdArray<f64>;

const SIZE: usize = 16;

/// The silhouette by the fused op and over every pair, and the stated error of the profile.
fn images(
    (vertices, faces): &(Vec<f64>, Arc<[[u32; 3]]>),
    softness: EdgeSoftness,
    t_conorm: TConorm,
    phi: &[f64],
    tolerance: f64,
) -> (Vec<f64>, Vec<f64>, f64) {
    let phi = vector::<B>(phi);
    let vertices = vector::<B>(vertices).reshape([1, vertices.len() as i64 / 3, 3]);
    let rasterizer = Rasterizer { tolerance, t_conorm, ..Rasterizer::new(SIZE) };
    let silhouette = rasterizer.prepare(faces, softness, &phi);
    let culled = silhouette.coverage(vertices.clone(), phi.clone());
    let scene = reference::Scene { faces, size: SIZE.into() };
    let sums = reference::sums(scene, vertices, &softness, t_conorm, phi);
    (numbers(culled), numbers(t_conorm.coverage(sums)), silhouette.profile().error())
}

/// Asserts that no image of a case has an error above the renderer's stated one.
fn assert_kept(case: &ToleranceCase) {
    for deviation in case.deviations() {
        assert!(deviation.is_kept(), "{deviation:?} of {case:?}");
    }
}

#[test]
fn no_pixel_is_off_by_more_than_is_stated_wherever_the_parameters_go() {
    (0..200).map(ToleranceCase::random).for_each(|case| assert_kept(&case));
}

#[test]
fn no_case_that_a_random_search_has_found_is_off_by_more_than_is_stated() {
    let found: Vec<ToleranceCase> =
        serde_json::from_str(include_str!("found.json")).expect("a list of cases");
    assert!(!found.is_empty());
    found.iter().for_each(assert_kept);
}

#[test]
fn the_tolerance_itself_is_kept_by_every_family_at_the_default() {
    for family in Family::ALL {
        for squared in [false, true] {
            for width in [1e-6, 1e-3, 1.0, 10.0] {
                let softness =
                    if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
                let scale = if squared { width * width } else { width };
                let mut renderer = SoftRenderer::new(&[[0, 1, 2]; 500], SIZE, softness, scale);
                let mut phi = renderer.phi().to_vec();
                let stated = renderer.error_bound::<B>();
                assert_eq!(stated, Rasterizer::TOLERANCE, "{family}, squared {squared}, {width}");
                let Some(shift) = phi.last_mut().filter(|_| softness.parameters() == 2) else {
                    continue;
                };
                // The law of one half line starts away from the edge.
                *shift -= 7.0;
                renderer.set_phi(phi);
                let stated = renderer.error_bound::<B>();
                assert_eq!(stated, Rasterizer::TOLERANCE, "{family}, squared {squared}, shifted");
            }
        }
    }
}

#[test]
fn heavy_tails_under_a_steep_t_conorm_get_the_knots_that_they_need() {
    let softness = EdgeSoftness::new(Family::Reciprocal);
    let phi = softness.default_phi(10f64.powf(-1.910_500_4));
    let tolerance = 10f64.powf(-6.260_48);
    let (culled, exact, error) =
        images(&triangles(0, 3), softness, TConorm::Dombi(0.5), &phi, tolerance);
    assert_eq!(error, tolerance);
    for (culled, exact) in culled.iter().zip(&exact) {
        assert!((culled - exact).abs() <= tolerance, "{culled} instead of {exact}");
    }
}

#[test]
fn a_face_counts_for_more_beside_another_where_coverage_steepens() {
    let softness = EdgeSoftness::new(Family::CubicHermite);
    let (phi, tolerance) = (softness.default_phi(1.0), 10f64.powf(-5.166_573_731_664_093));
    let yager = TConorm::Yager(0.545_809_260_379_082_7);
    let (culled, exact, error) = images(&triangles(0, 2), softness, yager, &phi, tolerance);
    assert_eq!(error, tolerance);
    for (culled, exact) in culled.iter().zip(&exact) {
        assert!((culled - exact).abs() <= tolerance, "{culled} instead of {exact}");
    }
}

#[test]
fn permuting_the_faces_changes_nothing_above_rounding() {
    let (vertices, faces) = triangles(3, 40);
    let mut shuffled = faces.to_vec();
    shuffled.rotate_left(13);
    shuffled.reverse();
    let softness = EdgeSoftness::new(Family::Logistic);
    let phi = softness.default_phi(0.05);
    let image = |faces: Arc<[[u32; 3]]>| {
        images(&(vertices.clone(), faces), softness, TConorm::Probabilistic, &phi, 1e-5).0
    };
    for (a, b) in image(faces).iter().zip(image(shuffled.into())) {
        assert!((a - b).abs() <= 1e-14 * 40.0);
    }
}
