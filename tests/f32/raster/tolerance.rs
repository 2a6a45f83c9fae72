//! No error of a pixel exceeds the stated bound, except for rounding in f32.

use rayon::prelude::*;
use softrast_raster::{SoftRenderer, TConorm};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::NdArray;
use softrast_tests::ToleranceCase;

fn assert_kept(case: &ToleranceCase) {
    for deviation in case.deviations_in_f32() {
        assert!(deviation.is_kept(), "{deviation:?} of {case:?}");
    }
}

#[test]
fn no_pixel_is_off_by_more_than_is_stated_and_rounding_explains() {
    (0..100).map(ToleranceCase::random).for_each(|case| assert_kept(&case));
}

#[test]
fn no_case_that_a_random_search_has_found_is_off_by_more_than_is_stated() {
    let found: Vec<ToleranceCase> =
        serde_json::from_str(include_str!("found.json")).expect("a list of cases");
    assert!(!found.is_empty());
    found.iter().for_each(assert_kept);
}

#[test]
fn every_number_of_a_table_fits_the_float_type() {
    let t_conorms = [
        "probabilistic",
        "einstein",
        "hamacher:8",
        "frank:16",
        "yager:4",
        "aczel_alsina:4",
        "dombi:4",
        "dombi:8",
        "schweizer_sklar:-4",
    ];
    let t_conorms = t_conorms.map(|name| name.parse::<TConorm>().expect("a T-conorm"));
    let steepest = (1e-6, 1e-7);
    let others = [(1e-2, 1e-2), (0.1, 1e-8), (10.0, 1e-5)];
    let families = Family::ALL.into_par_iter().enumerate();
    families.flat_map(|(at, it)| [(at, it, false), (at + 1, it, true)]).for_each(
        |(at, family, squared)| {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            for (beside, t_conorm) in t_conorms.into_iter().enumerate() {
                // The steepest one always, and one of the others in turn: each softness is combined with all, and so is each T-conorm.
                for (scale, tolerance) in [steepest, others[(at + beside) % others.len()]] {
                    let renderer = SoftRenderer::new(&[[0, 1, 2]], 8, softness, scale)
                        .with_tolerance(tolerance)
                        .with_t_conorm(t_conorm);
                    let silhouette = renderer.prepared::<NdArray<f32>>(renderer.phi());
                    let table = silhouette.table_data(renderer.phi());
                    let worst = table.iter::<f64>().fold(0.0, |most: f64, it| match it.is_nan() {
                        true => f64::INFINITY,
                        false => most.max(it.abs()),
                    });
                    assert!(
                        worst <= f64::from(f32::MAX),
                        "{worst:e} in a table of {softness:?}, {t_conorm}, {scale}, {tolerance}"
                    );
                }
            }
        },
    );
}
