//! Culling keeps its bound, and nothing depends on the order of faces.

use std::sync::Arc;

use burn::backend::NdArray;
use proptest::prelude::*;
use softrast_raster::{Rasterizer, TConorm, reference};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tests::{numbers, vector};

use super::triangles::triangles;

type B = NdArray<f64>;

const SIZE: usize = 16;

/// The silhouette through the fused op and over every pair, and the error of the profile.
fn images(
    (vertices, faces): &(Vec<f64>, Arc<[[u32; 3]]>),
    softness: EdgeSoftness,
    t_conorm: TConorm,
    phi: &[f64],
    tolerance: f64,
) -> (Vec<f64>, Vec<f64>, f64) {
    let phi = vector::<B>(phi);
    let vertices = vector::<B>(vertices).reshape([1, vertices.len() as i64 / 3, 3]);
    let rasterizer = Rasterizer { size: SIZE.into(), tolerance, t_conorm };
    let silhouette = rasterizer.prepare(faces, softness, &phi);
    let culled = silhouette.coverage(vertices.clone(), phi.clone());
    let scene = reference::Scene { faces, size: SIZE.into() };
    let sums = reference::sums(scene, vertices, &softness, t_conorm, phi);
    (numbers(culled), numbers(t_conorm.coverage(sums)), silhouette.profile().error())
}

fn t_conorm() -> impl Strategy<Value = TConorm> {
    prop_oneof![
        4 => Just(TConorm::Probabilistic),
        1 => Just(TConorm::Einstein),
        1 => (0.1..4.0).prop_map(TConorm::Hamacher),
        1 => (0.1..0.9).prop_map(TConorm::Frank),
        1 => (1.5..9.0).prop_map(TConorm::Frank),
        1 => (0.5..3.0).prop_map(TConorm::Yager),
        1 => (0.5..3.0).prop_map(TConorm::AczelAlsina),
        1 => (0.5..3.0).prop_map(TConorm::Dombi),
        1 => (-3.0..-0.3).prop_map(TConorm::SchweizerSklar),
    ]
}

/// Families with a corner that no knot meets: the straight line by which a Gamma law starts. At
/// tolerances far below the default their tables say that they need more than their share.
const ROUGH: [Family; 2] = [Family::Gamma, Family::GammaForward];

/// The default tolerance. Below it some tables with steep ends run out of knots, and say so. Found at random: Uniform
/// over the squared distance under Dombi(0.5) is left 5.7e-5 at 6.4e-7, `ExpForward` under Yager(0.5) 1.9e-6 at 2.3e-6.
const FINEST: f64 = 1e-5;

proptest! {
    #![proptest_config(softrast_test_kit::cases(300))]

    #[test]
    fn no_pixel_is_off_by_more_than_the_tolerance(
        seed in 0u64..1000,
        faces in 1usize..40,
        family in proptest::sample::select(Family::ALL.to_vec()),
        squared: bool,
        t_conorm in t_conorm(),
        width in -4.0f64..0.5,
        digits in 2.0f64..6.5,
    ) {
        let softness = EdgeSoftness { family, squared };
        let scale = 10f64.powf(if squared { 2.0 * width } else { width });
        let tolerance = 10f64.powf(-digits);
        let phi = softness.default_phi(scale);
        let (culled, exact, error) =
            images(&triangles(seed, faces), softness, t_conorm, &phi, tolerance);
        // Half the tolerance is for culling; interpolation says when it needs more than the rest.
        let bound = tolerance / 2.0 + error.max(tolerance / 2.0);
        prop_assert!(
            ROUGH.contains(&family)
                || tolerance < FINEST
                || error <= tolerance / 2.0,
            "interpolation error {error:e}"
        );
        for (pixel, (culled, exact)) in culled.iter().zip(&exact).enumerate() {
            prop_assert!(
                (culled - exact).abs() <= bound,
                "pixel {pixel}: {culled} instead of {exact}, off by {:e}",
                (culled - exact).abs()
            );
        }
    }
}

#[test]
fn heavy_tails_under_a_steep_t_conorm_get_the_knots_that_they_need() {
    let softness = EdgeSoftness { family: Family::Reciprocal, squared: false };
    let phi = softness.default_phi(10f64.powf(-1.910_500_4));
    let tolerance = 10f64.powf(-6.260_48);
    let (culled, exact, error) =
        images(&triangles(0, 3), softness, TConorm::Dombi(0.5), &phi, tolerance);
    assert!(error <= tolerance / 2.0, "interpolation error {error:e}");
    for (culled, exact) in culled.iter().zip(&exact) {
        assert!((culled - exact).abs() <= tolerance, "{culled} instead of {exact}");
    }
}

#[test]
fn a_face_counts_for_more_beside_another_where_coverage_steepens() {
    let softness = EdgeSoftness { family: Family::CubicHermite, squared: false };
    let (phi, tolerance) = (softness.default_phi(1.0), 10f64.powf(-5.166_573_731_664_093));
    let yager = TConorm::Yager(0.545_809_260_379_082_7);
    let (culled, exact, error) = images(&triangles(0, 2), softness, yager, &phi, tolerance);
    assert!(error <= tolerance / 2.0, "interpolation error {error:e}");
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
    let softness = EdgeSoftness { family: Family::Logistic, squared: false };
    let phi = softness.default_phi(0.05);
    let image = |faces: Arc<[[u32; 3]]>| {
        images(&(vertices.clone(), faces), softness, TConorm::Probabilistic, &phi, 1e-5).0
    };
    for (a, b) in image(faces).iter().zip(image(shuffled.into())) {
        assert!((a - b).abs() <= 1e-14 * 40.0);
    }
}
