//! Faces that break rasterizers: without area, behind the camera, on top of one another.

use softrast_raster::NEAR;

use super::{SCALE, SIZE, against_dense};
use crate::{
    Case, Level, Promise, Tested, Trial,
    drawn::{Drawing, Exact, Single, largest, weights},
    flat::Flat,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "F01",
        name: "pixels on edges and corners",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a triangle with its corners on the centres of pixels, 16 x 16",
        perturbation: "pixel centres on a corner and two edges, on a diagonal, on an edge's line",
        measure: "largest error of a pixel against every pair in f64",
        target: "at most 1e-5, gradient finite",
        run: on_edges,
    },
    Case {
        id: "F02",
        name: "slivers",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a triangle from left to right that gets thinner",
        perturbation: "width from 1e-1 to 1e-15 NDC",
        measure: "largest error of a pixel against every pair in f64",
        target: "at most 1e-5, gradient finite",
        run: slivers,
    },
    Case {
        id: "F03",
        name: "faces without area",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a face that is a point or a line, beside one that is not",
        perturbation: "three equal corners, two equal corners, three on a line",
        measure: "largest error of a pixel against every pair in f64",
        target: "at most 1e-5, gradient finite",
        run: without_area,
    },
    Case {
        id: "F04",
        name: "winding",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "20 triangles",
        perturbation: "all corners in the other order",
        measure: "largest difference of a pixel",
        target: "at most 1e-12 in f64",
        run: winding,
    },
    Case {
        id: "F05",
        name: "order of the faces",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "40 triangles, f32 and f64",
        perturbation: "4 permutations of the faces",
        measure: "largest difference of a pixel, in roundings of its float type times the faces",
        target: "at most 2",
        run: order,
    },
    Case {
        id: "F08",
        name: "behind and through the camera",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a triangle, one, two or three corners of which are moved in depth",
        perturbation: "depth of these corners: 1, 1e-7, 0, -1e-7, -1",
        measure: "largest pixel and gradient of a face that is nearer than the near plane",
        target: "exactly 0, and finite in front",
        run: behind,
    },
    Case {
        id: "F17",
        name: "faces that cross or coincide",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "two triangles that cross, share a plane, or are the same",
        perturbation: "how they lie",
        measure: "largest error of a pixel against every pair in f64",
        target: "at most 1e-5, gradient finite",
        run: crossing,
    },
    Case {
        id: "F19",
        name: "huge and tiny faces",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "8 triangles, all coordinates in the image times a factor",
        perturbation: "factor from 1e-9 to 1e9",
        measure: "largest error of a pixel against every pair in f64",
        target: "at most 1e-5, gradient finite in f32 too",
        run: scaled,
    },
    Case {
        id: "F21",
        name: "coordinates that are not numbers",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "one sound triangle, one with a broken corner",
        perturbation: "NaN, infinity, 1e300, -1e12 as a coordinate",
        measure: "largest difference of a pixel from the sound triangle alone, in f64",
        target: "at most 1e-5: broken faces are not drawn",
        run: broken,
    },
];

fn on_edges(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let (a, b) = (-7.0 / 16.0, 5.0 / 16.0);
    let quad = [[a, a], [b, a], [b, b], [a, a], [b, b], [a, b]].map(|[x, y]| [x, y, 2.0]);
    let scenes = [
        ("corner", Flat::triangle([[a, a], [b, a], [a, b]])),
        ("diagonal", Flat::loose(quad.into())),
        ("line", Flat::triangle([[a, a], [-1.0 / 16.0, a], [a, 0.21]])),
    ];
    against_dense(tested, scenes)
}

fn slivers(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let width = |width: f64| Flat::triangle([[-0.7, 0.0], [0.7, 0.1], [0.7, 0.1 + width]]);
    let widths = [1e-1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-10, 1e-15];
    against_dense(tested, widths.map(|w| (format!("{w:e}"), width(w))))
}

fn without_area(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let p = [0.1, 0.1];
    let beside = |degenerate: [[f64; 2]; 3]| {
        let mut corners = Flat::plain().corners;
        corners.extend(degenerate.map(|[x, y]| [x, y, 2.0]));
        Flat::loose(corners)
    };
    let scenes = [
        ("point", [p; 3]),
        ("two equal", [p, p, [0.3, 0.2]]),
        ("line", [[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]]),
    ];
    against_dense(tested, scenes.map(|(name, corners)| (name, beside(corners))))
}

fn crossing(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let one = Flat::plain().corners;
    let with = |other: [[f64; 3]; 3]| Flat::loose([&one[..], &other].concat());
    let scenes = [
        ("cross", with([[-0.5, 0.5, 1.0], [0.6, -0.2, 3.0], [0.4, 0.6, 2.5]])),
        ("share a plane", with([[-0.5, 0.5, 2.0], [0.6, -0.2, 2.0], [0.4, 0.6, 2.0]])),
        ("are the same", with([one[0], one[1], one[2]])),
    ];
    against_dense(tested, scenes)
}

fn winding(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let flat = Flat::random(4, 20);
    let turned =
        Flat { faces: flat.faces.iter().map(|&[a, b, c]| [c, b, a]).collect(), ..flat.clone() };
    let [one, other] =
        [&flat, &turned].map(|flat| Drawing::new(&method, flat, SIZE).fused::<Exact>());
    Ok(vec![Level::named(
        "turned",
        vec![Trial::at_most(one.off(&other), 1e-12).with(&other.all())],
    )])
}

fn order(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let flat = Flat::random(5, 40);
    let single = Drawing::new(&method, &flat, SIZE).fused::<Single>();
    let exact = Drawing::new(&method, &flat, SIZE).fused::<Exact>();
    let [mut singles, mut exacts] = [Vec::new(), Vec::new()];
    for seed in 0..4 {
        let flat = flat.permuted(seed);
        let drawing = Drawing::new(&method, &flat, SIZE);
        let [a, b] = [drawing.fused::<Single>(), drawing.fused::<Exact>()];
        let faces = flat.faces.len() as f64;
        let trial = |off: f64, rounding: f64| Trial::at_most(off / (rounding * faces), 2.0);
        singles.push(trial(a.off(&single), f64::from(f32::EPSILON)).with(&a.all()));
        exacts.push(trial(b.off(&exact), f64::EPSILON).with(&b.all()));
    }
    Ok(vec![Level::named("f32", singles), Level::named("f64", exacts)])
}

fn behind(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(0.1)?;
    let painter = Drawing::new(&method, &Flat::plain(), SIZE).painter::<Single>();
    let level = |depth: f64| {
        let trial = |moved: usize| {
            let mut flat = Flat::plain();
            flat.corners[..moved].iter_mut().for_each(|corner| corner[2] = depth);
            let drawn = painter.draw(&flat, &weights(SIZE));
            let most = if depth >= NEAR { 0.0 } else { largest(drawn.all()) };
            Trial::at_most(most, 0.0).with(&drawn.all())
        };
        Level::new(depth, [1, 2, 3].map(trial).into())
    };
    Ok([1.0, 1e-7, 0.0, -1e-7, -1.0].map(level).into())
}

fn scaled(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let factors = [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9];
    against_dense(tested, factors.map(|x| (format!("{x:e}"), Flat::random(6, 8).scaled(x))))
}

fn broken(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let sound = Flat::plain();
    let alone = Drawing::new(&method, &sound, SIZE).fused::<Exact>();
    let mut corners = sound.corners.clone();
    corners.extend([[0.0, 0.0, 2.0], [0.5, 0.0, 2.0], [0.0, 0.5, 2.0]]);
    let both = Flat::loose(corners);
    let painter = Drawing::new(&method, &both, SIZE).painter::<Exact>();
    let level = |number: f64| {
        let trial = |axis: usize| {
            let mut flat = both.clone();
            flat.corners[3][axis] = number;
            let drawn = painter.draw(&flat, &weights(SIZE));
            Trial::at_most(drawn.off(&alone), 1e-5).with(&drawn.all())
        };
        Level::named(format!("{number:e}"), [0, 1].map(trial).into())
    };
    Ok([f64::NAN, f64::INFINITY, 1e300, -1e12].map(level).into())
}
