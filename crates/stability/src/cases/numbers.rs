//! Softnesses, tolerances and coordinates at the ends of what numbers can hold.

use softrast_mesh::{Mesh, icosphere};
use softrast_method::{Method, MovingSilhouette, numbers, tensor};
use softrast_raster::{RasterBackend, Rasterizer, project};
use softrast_softness::{ScheduledSoftness, Softness};

use super::{SCALE, SIZE};
use crate::{
    Case, Level, Promise, Tested, Trial,
    drawn::{Drawing, Exact, Single, largest},
    flat::Flat,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "F13",
        name: "culling against all pairs",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "30 triangles, softness 0.05 NDC",
        perturbation: "tolerance from 1e-2 to 1e-8",
        measure: "largest error of a pixel against every pair, in tolerances",
        target: "at most 1 (1.5 below 1e-6 where a family has a corner between knots)",
        run: culling,
    },
    Case {
        id: "F15",
        name: "f32 against f64, world scaled",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "an icosahedron and its camera, both times a factor, softness 0.02 NDC",
        perturbation: "factor from 1e-1 to 1e6 (nearer, the near plane cuts it off)",
        measure: "largest difference of a pixel between the float types",
        target: "at most 1e-4",
        run: world,
    },
    Case {
        id: "F18",
        name: "softness from 1e-12 to 1e3",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "12 triangles",
        perturbation: "softness from 1e-12 to 1e3 NDC",
        measure: "largest error of a pixel against every pair in f64",
        target: "at most 1e-5, and image and gradient finite in f32",
        run: softness,
    },
    Case {
        id: "F22",
        name: "softness files with NaN and infinity",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a softness file of the family, one number replaced",
        perturbation: "NaN, infinity, 1e999, a word, none",
        measure: "files that are taken instead of refused",
        target: "none",
        run: files,
    },
    Case {
        id: "F23",
        name: "meshes with NaN and infinity",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "an OBJ file with a broken vertex",
        perturbation: "nan, inf, 1e400, a word",
        measure: "meshes that are taken instead of refused",
        target: "none",
        run: meshes,
    },
    Case {
        id: "F24",
        name: "hostile parameters",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "12 triangles; all parameters of the softness replaced",
        perturbation: "all equal, huge, zero, negative, alternating",
        measure: "share of pixels outside [0, 1]",
        target: "0, and image and gradient finite in f32",
        run: parameters,
    },
];

fn culling(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(0.05)?;
    let flat = Flat::random(8, 30);
    let dense = Drawing::new(&method, &flat, SIZE).dense();
    let level = |tolerance: f64| {
        let drawing = Drawing { tolerance, ..Drawing::new(&method, &flat, SIZE) };
        let drawn = drawing.fused::<Exact>();
        let limit = if tolerance < 1e-6 { 1.5 } else { 1.0 };
        let off = drawn.off(&dense) / tolerance;
        Level::new(tolerance, vec![Trial::at_most(off, limit).with(&drawn.all())])
    };
    Ok([1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8].map(level).into())
}

fn world(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(0.02)?;
    let sphere = icosphere(0);
    let level = |factor: f64| {
        let exact = viewed::<Exact>(&method, &sphere, factor);
        let single = viewed::<Single>(&method, &sphere, factor);
        let off = largest(exact.iter().zip(&single).map(|(a, b)| a - b));
        Level::new(factor, vec![Trial::at_most(off, 1e-4).with(&single)])
    };
    Ok([1e-1, 1.0, 1e1, 1e3, 1e6].map(level).into())
}

/// The silhouette of a mesh whose coordinates and camera are multiplied by `factor`.
fn viewed<B: RasterBackend>(method: &Method, mesh: &Mesh, factor: f64) -> Vec<f64> {
    let positions: Vec<f64> = mesh.positions().iter().flatten().map(|x| factor * x).collect();
    let vertices = tensor::<B, 3>(positions, [1, mesh.positions().len(), 3]);
    let orbit = tensor::<B, 2>(vec![3.0 * factor, 21.0, 35.0, 25.0], [1, 4]);
    let scale = method.scale(1, 1);
    let faces = mesh.faces().into();
    let silhouette = MovingSilhouette::new(method, Rasterizer::new(SIZE), &faces, scale);
    numbers(silhouette.image(project(vertices, orbit)))
}

fn softness(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let flat = Flat::random(9, 12);
    let level = |scale: f64| {
        let method = tested.method_at(scale)?;
        let drawing = Drawing::new(&method, &flat, SIZE);
        let off = drawing.fused::<Exact>().off(&drawing.dense());
        let single = drawing.fused::<Single>();
        Ok(Level::new(scale, vec![Trial::at_most(off, 1e-5).with(&single.all())]))
    };
    [1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 1e-1, 1e1, 1e3].map(level).into_iter().collect()
}

fn files(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let (softness, phi) = (method.softness(), method.phi(method.scale(1, 1)));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("softness.json");
    let level = |word: &str| {
        let mut words: Vec<String> = phi.iter().map(|x| format!("{x:?}")).collect();
        word.clone_into(&mut words[0]);
        let text = format!(
            "{{\"softness\": {}, \"phi\": [{}]}}",
            serde_json::to_string(&softness)?,
            words.join(", ")
        );
        std::fs::write(&path, text)?;
        let refused = ScheduledSoftness::load(&path).is_err();
        Ok(Level::named(word, vec![Trial::holds(refused)]))
    };
    ["NaN", "Infinity", "1e999", "\"wide\"", "null"].map(level).into_iter().collect()
}

fn meshes(_: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |word: &str| {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 {word} 0\nf 1 2 3\n");
        Level::named(word, vec![Trial::holds(Mesh::parse(text.as_bytes(), "broken.obj").is_err())])
    };
    Ok(["nan", "inf", "1e400", "wide"].map(level).into())
}

fn parameters(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let edge = method.softness();
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("softness.json");
    let flat = Flat::random(10, 12);
    // Of families other than the network a parameter is a logarithm or a shift.
    let big = if edge.parameters() > 3 { 1e4 } else { 60.0 };
    let small = if edge.parameters() > 3 { -1.0 } else { -60.0 };
    // Name, sign of each parameter, their size.
    type Weights = (&'static str, fn(usize) -> f64, f64);
    let levels: [Weights; 5] = [
        ("all equal", |_| 1.0, 0.5),
        ("huge", |_| 1.0, big),
        ("zero", |_| 0.0, 1.0),
        ("negative", |_| 1.0, small),
        ("alternating", |k| if k.is_multiple_of(2) { 1.0 } else { -1.0 }, 3.0),
    ];
    let level = |(name, sign, size): Weights| {
        let phi = (0..edge.parameters()).map(|k| sign(k) * size).collect();
        ScheduledSoftness {
            softness: edge,
            phi,
            schedule: None,
            surrogate: None,
            learning_rate: None,
            task: None,
            note: None,
        }
        .save(&path)?;
        let method = super::from_file(&path)?;
        let single = Drawing::new(&method, &flat, SIZE).fused::<Single>();
        let outside = single.image.iter().filter(|a| !(0.0..=1.0).contains(*a)).count();
        let share = outside as f64 / single.image.len() as f64;
        Ok(Level::named(name, vec![Trial::at_most(share, 0.0).with(&single.all())]))
    };
    levels.map(level).into_iter().collect()
}
