//! The appearance of an instance, small enough to read.

use occlusion::{Instance, Problem, Scene};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, tensor, vector};

type B = NdArray<f64>;

const SIZE: usize = 16;

/// The colours of a picture as letters, one row per line: upper case for the bright shade of a quad, lower case for the dark one, a dot for
/// black, a question mark for a mixture.
fn letters(image: &[f64], instance: &Instance) -> String {
    let pixels = SIZE * SIZE;
    let letter = |pixel: usize| {
        let colour = [0, 1, 2].map(|channel| image[channel * pixels + pixel]);
        let like = |other: [f64; 3]| (0..3).all(|k| (colour[k] - other[k]).abs() < 0.02);
        let bright = instance.quads.iter().map(|quad| quad.texture.colour);
        let shades = bright.flat_map(|bright| [bright, bright.map(|channel| 0.55 * channel)]);
        let named = shades.zip(['A', 'a', 'B', 'b', 'C', 'c']).chain([([0.0; 3], '.')]);
        named.into_iter().find(|&(shade, _)| like(shade)).map_or('?', |(_, letter)| letter)
    };
    let rows = (0..SIZE).map(|row| (0..SIZE).map(|column| letter(row * SIZE + column)).collect());
    rows.collect::<Vec<String>>().join("\n")
}

#[test]
fn the_target_of_seed_0_shows_three_quads_and_so_does_a_narrow_softness() {
    let instance = Instance::seeded(0, &Problem::ORIGINAL);
    let scene = Scene::<B>::new(&Problem::ORIGINAL, std::slice::from_ref(&instance), SIZE);
    let target = numbers(scene.target());
    let found = letters(&target, &instance);
    let expected = include_str!("seed0.txt").trim_end();
    assert_eq!(found, expected, "found:\n{found}");

    let edge = EdgeSoftness::new(Family::Logistic);
    let depth = DepthSoftness::Family(Family::Logistic);
    let theta = tensor::<B, 2>(&instance.target, [1, 3]);
    let drawn = |depth_scale: f64| {
        let edges = scene.edges(&edge, vector(&edge.default_phi(1e-7)));
        let phi = vector(&depth.default_phi(depth_scale));
        let image = scene.image(theta.clone(), edges, depth, phi);
        letters(&numbers(image), &instance)
    };
    assert_eq!(drawn(3e-3), expected);
    // A wide softness mixes the colours of overlaps and of nothing else.
    let soft = drawn(0.3);
    assert!(soft.contains('?') && soft.contains('.'), "{soft}");
    assert!(soft.chars().zip(expected.chars()).all(|(s, e)| s == e || s == '?'), "{soft}");
}
