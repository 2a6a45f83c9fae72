//! Many faces: copies, stacks, a haze from afar, thousands in a pixel; and image sizes.

use stability::{
    Level, Tested, Trial,
    cases::SCALE,
    drawing::{Exact, RenderRequest, Single, largest},
    planar_scene::PlanarScene,
};

use crate::{Levels, SIZE, hold, hold_where_tails_end};

/// F06: 1 to 64 copies.
#[test]
fn copies_of_a_face_are_one_minus_a_power() {
    hold(copies);
}

/// F09.
#[test]
fn nothing_everything_and_far_away_are_0_or_1() {
    hold_where_tails_end(extremes);
}

/// F10, in f32.
#[test]
fn stacks_of_10_000_faces_are_one_minus_a_power() {
    hold(stacks);
}

/// F11.
#[test]
fn many_faces_far_away_are_no_haze() {
    hold_where_tails_end(haze);
}

/// F14.
#[test]
fn ten_thousand_faces_in_a_pixel_are_drawn() {
    hold(crowd);
}

/// F20.
#[test]
fn mean_coverage_does_not_depend_on_the_image_size() {
    hold(sizes);
}

/// `1 - (1 - s)^count` of one triangle, from the definition.
fn stacked(tested: &Tested, scale: f64, count: usize) -> anyhow::Result<Vec<f64>> {
    let softness = tested.at(scale);
    let one = RenderRequest::new(&softness, &PlanarScene::plain(), SIZE).dense();
    Ok(one.image.iter().map(|a| -((1.0 - a).ln() * count as f64).exp_m1()).collect())
}

fn worst(found: &[f64], expected: &[f64]) -> f64 {
    largest(found.iter().zip(expected).map(|(a, b)| a - b))
}

fn copies(tested: &Tested) -> Levels {
    let level = |count: usize| {
        let softness = tested.at(0.1);
        let drawn =
            RenderRequest::new(&softness, &PlanarScene::stack(count), SIZE).fused::<Exact>();
        let off = worst(&drawn.image, &stacked(tested, 0.1, count)?);
        Ok(Level::new(count as f64, vec![Trial::at_most(off, 1e-5).with(&drawn.all())]))
    };
    [1, 2, 4, 16, 64].map(level).into_iter().collect()
}

fn extremes(tested: &Tested) -> Levels {
    let far = |x: f64| PlanarScene::triangle([[x, x], [x + 1.0, x], [x, x + 1.0]]);
    let around = PlanarScene::triangle([[-1e3, -1e3], [1e3, -1e3], [0.0, 2e3]]);
    let softness = tested.at(SCALE);
    let level = |(name, flat, expected): (&str, PlanarScene, f64)| {
        let drawn = RenderRequest::new(&softness, &flat, SIZE).fused::<Single>();
        let off = worst(&drawn.image, &vec![expected; SIZE * SIZE]);
        Level::named(name, vec![Trial::at_most(off, 1e-5).with(&drawn.all())])
    };
    Ok([("outside", far(5.0), 0.0), ("far outside", far(1e6), 0.0), ("around", around, 1.0)]
        .map(level)
        .into())
}

fn stacks(tested: &Tested) -> Levels {
    let level = |count: usize| {
        let softness = tested.at(0.3);
        let drawn =
            RenderRequest::new(&softness, &PlanarScene::stack(count), SIZE).fused::<Single>();
        let off = worst(&drawn.image, &stacked(tested, 0.3, count)?);
        let limit = 1e-5 + f64::from(f32::EPSILON) * count as f64;
        Ok(Level::new(count as f64, vec![Trial::at_most(off, limit).with(&drawn.all())]))
    };
    [100, 1000, 10_000].map(level).into_iter().collect()
}

fn haze(tested: &Tested) -> Levels {
    let softness = tested.at(0.01);
    let level = |count: usize| {
        let corners = [[2.0, -0.5, 2.0], [3.0, 0.0, 2.0], [2.0, 0.5, 2.0]];
        let flat = PlanarScene::loose((0..count).flat_map(|_| corners).collect());
        let drawn = RenderRequest::new(&softness, &flat, SIZE).fused::<Single>();
        let most = largest(drawn.image.iter().copied());
        Level::new(count as f64, vec![Trial::at_most(most, 1e-3).with(&drawn.all())])
    };
    Ok([16, 128, 1280].map(level).into())
}

fn crowd(tested: &Tested) -> Levels {
    let softness = tested.at(SCALE);
    let level = |side: usize| {
        let flat = PlanarScene::grid(side).scaled(0.07 * 2.0 / SIZE as f64);
        let drawn = RenderRequest::new(&softness, &flat, SIZE).fused::<Single>();
        let sound = drawn.image.iter().filter(|a| (0.0..=1.0).contains(*a)).count();
        let missing = 1.0 - sound as f64 / drawn.image.len() as f64;
        let faces = flat.faces.len() as f64;
        Level::new(faces, vec![Trial::at_most(missing, 0.0).with(&drawn.all())])
    };
    Ok([8, 32, 71].map(level).into())
}

fn sizes(tested: &Tested) -> Levels {
    let softness = tested.at(0.1);
    let mean = |size: usize| {
        let image =
            RenderRequest::new(&softness, &PlanarScene::plain(), size).fused::<Single>().image;
        image.iter().sum::<f64>() / image.len() as f64
    };
    let full = mean(1024);
    let level = |size: usize| {
        Level::new(size as f64, vec![Trial::at_most((mean(size) - full).abs(), 1.0 / size as f64)])
    };
    Ok([8, 16, 32, 64, 256].map(level).into())
}
