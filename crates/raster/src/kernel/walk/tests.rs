//! Every instruction set that a walk is compiled for gives the same bits.

use std::fmt::Debug;

use super::*;
use crate::kernel::{bands::Bands, real::Dual};

type Walk<T> = fn(&Scene<T>, Place<T>, &[<T as Real>::Float], &mut [T], &mut BandGradient<T>);

const SIZE: usize = 50;
const FACES: u32 = 45;
const VERTICES: usize = 60;

#[target_feature(enable = "avx2")]
fn avx2<T: Real>(
    scene: &Scene<T>,
    place: Place<T>,
    upstream: &[T::Float],
    image: &mut [T],
    gradient: &mut BandGradient<T>,
) {
    walk::<T, true, true, true>(scene, place, upstream, image, gradient);
}

fn with_avx2<T: Real>(
    scene: &Scene<T>,
    place: Place<T>,
    upstream: &[T::Float],
    image: &mut [T],
    gradient: &mut BandGradient<T>,
) {
    assert!(is_x86_feature_detected!("avx2"));
    // SAFETY: the feature was just detected.
    #[allow(unsafe_code)]
    unsafe {
        avx2(scene, place, upstream, image, gradient);
    }
}

/// All digits of what a walk over the first band of some triangles gives, with a table that has
/// so many octaves at its far end; `number` gives the k-th input, whose value is the float.
fn digits<T: Real + Debug>(walk: Walk<T>, far: u32, number: fn(usize, f64) -> T) -> String {
    let grid = Grid { outer: 0.3, inner: 0.2, octaves: 12, far, bits: 2 };
    let wave = |k: usize, step: f64| (step * k as f64).sin();
    let place_of = |k: usize| if k < 2 * VERTICES { wave(k, 1.7) } else { 2.0 };
    let vertices: Vec<T> = (0..3 * VERTICES).map(|k| number(k, place_of(k))).collect();
    let row = |k: usize| [0, 1, 2, 3].map(|c| number(k + c, wave(4 * k + c, 0.7)));
    let table: Vec<[T; 4]> = (0..grid.rows()).map(row).collect();
    let faces: Vec<_> = (0..FACES).map(|f| [f, (7 * f + 3) % 60, (11 * f + 8) % 60]).collect();
    let values: Vec<T::Float> = vertices.iter().map(|v| v.value()).collect();
    let bands = Bands::new(&values, VERTICES, &faces, SIZE, 0.01, grid.outer);

    let scene = Scene::new(&vertices, &faces, &table, grid, SIZE);
    let place = Place { vertices: &vertices, view: &bands.views[0], band: 0 };
    let length = ROWS * scene.stride();
    let upstream: Vec<T::Float> = (0..length).map(|k| T::Float::from_f64(wave(k, 0.3))).collect();
    let mut image = vec![T::ZERO; length];
    let listed = place.view.faces(0).len();
    assert!(listed > 2 * BLOCK, "only {listed} faces");
    let mut gradient = BandGradient {
        corners: vec![[T::ZERO; 6]; listed],
        table: vec![[T::ZERO; 4]; grid.rows()],
    };
    walk(&scene, place, &upstream, &mut image, &mut gradient);
    format!("{image:?} {:?} {:?}", gradient.corners, gradient.table)
}

fn assert_same_on_every_set<T: Real + Debug>(number: fn(usize, f64) -> T) {
    let same: [(Walk<T>, Walk<T>); 4] = [
        (walk::<T, true, false, false>, walk_image),
        (walk::<T, false, true, false>, walk_gradient),
        (walk::<T, false, true, true>, walk_gradient_and_table),
        (walk::<T, true, true, true>, walk_everything),
    ];
    for far in [0, 9] {
        for (k, (portable, dispatched)) in same.into_iter().enumerate() {
            let same = digits(portable, far, number) == digits(dispatched, far, number);
            assert!(same, "walk {k}, {far} octaves at the far end");
        }
        if is_x86_feature_detected!("avx2") {
            let portable = digits(walk::<T, true, true, true>, far, number);
            assert!(portable == digits(with_avx2, far, number), "avx2, {far}");
        }
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    assert_same_on_every_set::<f32>(|_, value| value as f32);
    assert_same_on_every_set::<f64>(|_, value| value);
    assert_same_on_every_set::<Dual<f64>>(|k, value| Dual { value, tangent: (k as f64).cos() });
    assert_same_on_every_set::<Dual<f32>>(|k, value| Dual {
        value: value as f32,
        tangent: (k as f32).cos(),
    });
}
