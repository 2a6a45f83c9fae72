//! No pixel is off by more than is stated, but for the rounding of f32.

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
