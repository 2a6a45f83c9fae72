//! Faces that break rasterizers: without area, behind the camera, on top of one another.

use softrast_raster::NEAR;
use stability::{
    Level, Tested, Trial,
    cases::SCALE,
    drawing::{Exact, RenderRequest, Single, largest, weights},
    planar_scene::{PlanarScene, Random},
};

use crate::{Levels, SIZE, against_dense, hold, hold_where_tails_end};

/// F01: pixel centres on a corner and two edges, on a diagonal, on the line of an edge.
#[test]
fn pixels_on_edges_and_corners_are_as_defined() {
    hold(on_edges);
}

/// F02.
#[test]
fn slivers_down_to_1e_15_are_as_defined() {
    hold(slivers);
}

/// F03: a point, two equal corners, three on a line.
#[test]
fn faces_without_area_are_as_defined() {
    hold(without_area);
}

/// F17.
#[test]
fn faces_that_cross_or_coincide_are_as_defined() {
    hold(crossing);
}

/// F19: coordinates times 1e-9 to 1e9. Faces beyond 1e6 NDC are not drawn, which a tail that does not end would show.
#[test]
fn huge_and_tiny_faces_are_as_defined() {
    hold_where_tails_end(scaled);
}

/// F04.
#[test]
fn winding_changes_nothing() {
    hold(winding);
}

/// F05.
#[test]
fn the_order_of_the_faces_changes_no_more_than_rounding() {
    hold(order);
}

/// F08.
#[test]
fn a_face_with_a_corner_before_the_near_plane_is_not_drawn() {
    hold(behind);
}

/// F21.
#[test]
fn a_face_with_a_corner_that_is_no_number_is_not_drawn() {
    hold(broken);
}

fn on_edges(tested: &Tested) -> Levels {
    let (a, b) = (-7.0 / 16.0, 5.0 / 16.0);
    let quad = [[a, a], [b, a], [b, b], [a, a], [b, b], [a, b]].map(|[x, y]| [x, y, 2.0]);
    let scenes = [
        ("corner", PlanarScene::triangle([[a, a], [b, a], [a, b]])),
        ("diagonal", PlanarScene::loose(quad.into())),
        ("line", PlanarScene::triangle([[a, a], [-1.0 / 16.0, a], [a, 0.21]])),
    ];
    against_dense(tested, scenes)
}

fn slivers(tested: &Tested) -> Levels {
    let width = |width: f64| PlanarScene::triangle([[-0.7, 0.0], [0.7, 0.1], [0.7, 0.1 + width]]);
    let widths = [1e-1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-10, 1e-15];
    against_dense(tested, widths.map(|w| (format!("{w:e}"), width(w))))
}

fn without_area(tested: &Tested) -> Levels {
    let p = [0.1, 0.1];
    let beside = |degenerate: [[f64; 2]; 3]| {
        let mut corners = PlanarScene::plain().corners;
        corners.extend(degenerate.map(|[x, y]| [x, y, 2.0]));
        PlanarScene::loose(corners)
    };
    let scenes = [
        ("point", [p; 3]),
        ("two equal", [p, p, [0.3, 0.2]]),
        ("line", [[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]]),
    ];
    against_dense(tested, scenes.map(|(name, corners)| (name, beside(corners))))
}

fn crossing(tested: &Tested) -> Levels {
    let one = PlanarScene::plain().corners;
    let with = |other: [[f64; 3]; 3]| PlanarScene::loose([&one[..], &other].concat());
    let scenes = [
        ("cross", with([[-0.5, 0.5, 1.0], [0.6, -0.2, 3.0], [0.4, 0.6, 2.5]])),
        ("share a plane", with([[-0.5, 0.5, 2.0], [0.6, -0.2, 2.0], [0.4, 0.6, 2.0]])),
        ("are the same", with([one[0], one[1], one[2]])),
    ];
    against_dense(tested, scenes)
}

fn scaled(tested: &Tested) -> Levels {
    let factors = [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9];
    against_dense(tested, factors.map(|x| (format!("{x:e}"), PlanarScene::random(6, 8).scaled(x))))
}

fn winding(tested: &Tested) -> Levels {
    let softness = tested.at(SCALE);
    let flat = PlanarScene::random(4, 20);
    let turned = PlanarScene {
        faces: flat.faces.iter().map(|&[a, b, c]| [c, b, a]).collect(),
        ..flat.clone()
    };
    let [one, other] =
        [&flat, &turned].map(|flat| RenderRequest::new(&softness, flat, SIZE).fused::<Exact>());
    Ok(vec![Level::named(
        "turned",
        vec![Trial::at_most(one.off(&other), 1e-12).with(&other.all())],
    )])
}

/// The faces in another order.
fn permuted(flat: &PlanarScene, seed: u64) -> PlanarScene {
    let mut random = Random::new(seed);
    let mut faces = flat.faces.to_vec();
    for k in (1..faces.len()).rev() {
        faces.swap(k, (random.unit() * (k + 1) as f64) as usize);
    }
    PlanarScene { corners: flat.corners.clone(), faces: faces.into() }
}

fn order(tested: &Tested) -> Levels {
    let softness = tested.at(SCALE);
    let flat = PlanarScene::random(5, 40);
    let single = RenderRequest::new(&softness, &flat, SIZE).fused::<Single>();
    let exact = RenderRequest::new(&softness, &flat, SIZE).fused::<Exact>();
    let [mut singles, mut exacts] = [Vec::new(), Vec::new()];
    for seed in 0..4 {
        let flat = permuted(&flat, seed);
        let drawing = RenderRequest::new(&softness, &flat, SIZE);
        let [a, b] = [drawing.fused::<Single>(), drawing.fused::<Exact>()];
        let faces = flat.faces.len() as f64;
        let trial = |off: f64, rounding: f64| Trial::at_most(off / (rounding * faces), 2.0);
        singles.push(trial(a.off(&single), f64::from(f32::EPSILON)).with(&a.all()));
        exacts.push(trial(b.off(&exact), f64::EPSILON).with(&b.all()));
    }
    Ok(vec![Level::named("f32", singles), Level::named("f64", exacts)])
}

fn behind(tested: &Tested) -> Levels {
    let softness = tested.at(0.1);
    let renderer = RenderRequest::new(&softness, &PlanarScene::plain(), SIZE).renderer::<Single>();
    let level = |depth: f64| {
        let trial = |moved: usize| {
            let mut flat = PlanarScene::plain();
            flat.corners[..moved].iter_mut().for_each(|corner| corner[2] = depth);
            let drawn = renderer.draw(&flat, &weights(SIZE));
            let most = if depth >= NEAR { 0.0 } else { largest(drawn.all()) };
            Trial::at_most(most, 0.0).with(&drawn.all())
        };
        Level::new(depth, [1, 2, 3].map(trial).into())
    };
    Ok([1.0, 1e-7, 0.0, -1e-7, -1.0].map(level).into())
}

fn broken(tested: &Tested) -> Levels {
    let softness = tested.at(SCALE);
    let sound = PlanarScene::plain();
    let alone = RenderRequest::new(&softness, &sound, SIZE).fused::<Exact>();
    let mut corners = sound.corners.clone();
    corners.extend([[0.0, 0.0, 2.0], [0.5, 0.0, 2.0], [0.0, 0.5, 2.0]]);
    let both = PlanarScene::loose(corners);
    let renderer = RenderRequest::new(&softness, &both, SIZE).renderer::<Exact>();
    let level = |number: f64| {
        let trial = |axis: usize| {
            let mut flat = both.clone();
            flat.corners[3][axis] = number;
            let drawn = renderer.draw(&flat, &weights(SIZE));
            Trial::at_most(drawn.off(&alone), 1e-5).with(&drawn.all())
        };
        Level::named(format!("{number:e}"), [0, 1].map(trial).into())
    };
    Ok([f64::NAN, f64::INFINITY, 1e300, -1e12].map(level).into())
}
