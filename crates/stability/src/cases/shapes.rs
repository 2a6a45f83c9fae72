//! 2D SHAPE and 3D SHAPE: thin and empty targets, few and many faces, extreme settings.

use std::path::{Path, PathBuf};

use burn::tensor::Tensor;
use image::{GrayImage, Luma};
use shape2d::{Instance, Logo, Scene, Shape2d};
use shape3d::Shape3d;
use softrast_mesh::icosphere;
use softrast_runner::Variant;

use super::poses::{end, trials};
use crate::{
    Case, Level, Promise, Tested, Trial,
    descent::{Descent, Loss},
    drawn::{Drawing, Single},
    flat::Flat,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O10",
        name: "thin spokes",
        quick: false,
        promise: Promise::Measured,
        scene: "2D SHAPE, 60 triangles, 32 x 32, 80 steps; the target is a cross of thin bars",
        perturbation: "width of the bars, 1 to 6 pixels",
        measure: "hard error over that of an empty image",
        target: "at most 0.5",
        run: spokes,
    },
    Case {
        id: "O11",
        name: "triangles that die",
        quick: false,
        promise: Promise::Measured,
        scene: "2D SHAPE, 80 triangles, letters at 32 x 32, 60 steps without its smoothness",
        perturbation: "softness at the last step from 1e-4 to 0.1 NDC",
        measure: "share of the triangles without any gradient at the end",
        target: "at most 0.02",
        run: dying,
    },
    Case {
        id: "O12",
        name: "2D SHAPE by faces",
        quick: true,
        promise: Promise::Measured,
        scene: "2D SHAPE, letters at 32 x 32, 60 steps",
        perturbation: "8 to 512 triangles",
        measure: "hard error",
        target: "at most 0.1",
        run: counts,
    },
    Case {
        id: "O29",
        name: "2D SHAPE by learning rate",
        quick: false,
        promise: Promise::Measured,
        scene: "2D SHAPE, 80 triangles, letters at 32 x 32, 60 steps, 2 seeds",
        perturbation: "learning rate from 1e-4 to 1",
        measure: "hard error",
        target: "at most 0.1",
        run: rates,
    },
    Case {
        id: "O30",
        name: "2D SHAPE, softness from 1e-12 to 1e3",
        quick: true,
        promise: Promise::Measured,
        scene: "2D SHAPE, 80 triangles, letters at 32 x 32, 40 steps",
        perturbation: "softness from 1e-12 to 1e3 NDC",
        measure: "hard error",
        target: "at most 0.1",
        run: scales,
    },
    Case {
        id: "O21",
        name: "pictures that show no shape",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "2D SHAPE, 20 triangles, 16 x 16, 20 steps of 0.1",
        perturbation: "a picture all black, all white, of one pixel; an image of one pixel",
        measure: "1 if a number is not finite, or no warning tells of a picture without a shape",
        target: "0",
        run: no_shape,
    },
    Case {
        id: "O15",
        name: "3D SHAPE by elevation",
        quick: false,
        promise: Promise::Measured,
        scene: "3D SHAPE, the airplane from a sphere of 80 faces, 24 views of 24 x 24, 30 steps",
        perturbation: "elevation of the cameras: 30, 60, 0, -30, -60 degrees",
        measure: "hard IoU loss",
        target: "at most 0.5",
        run: elevations,
    },
    Case {
        id: "O31",
        name: "3D SHAPE by softness",
        quick: false,
        promise: Promise::Measured,
        scene: "3D SHAPE, the airplane from a sphere of 80 faces, 24 views of 24 x 24, 20 steps",
        perturbation: "softness at the last step from 1e-6 to 1 NDC",
        measure: "hard IoU loss",
        target: "at most 0.6",
        run: softness,
    },
];

fn with_limit(mut trials: Vec<Trial>, limit: f64) -> Vec<Trial> {
    trials.iter_mut().for_each(|trial| trial.reached = trial.finite && trial.value <= limit);
    trials
}

fn shape(tested: &Tested, flags: &str, runs: usize, limit: f64) -> anyhow::Result<Vec<Trial>> {
    let hard =
        trials::<Shape2d>(tested, flags, runs, |run| end(run).map_or(f64::NAN, |end| end.extra[0]));
    Ok(with_limit(hard?, limit))
}

/// A picture of `side` × `side` pixels, white where `white` says.
fn picture(folder: &Path, side: u32, white: impl Fn(u32, u32) -> bool) -> anyhow::Result<PathBuf> {
    let path = folder.join("target.png");
    GrayImage::from_fn(side, side, |x, y| Luma([if white(x, y) { 255 } else { 0 }])).save(&path)?;
    Ok(path)
}

fn spokes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |width: u32| {
        let folder = tempfile::tempdir()?;
        let bar = |x: u32| (16 - width.div_ceil(2)..16 + width / 2).contains(&x);
        let white =
            |x: u32, y: u32| (bar(x) || bar(y)) && (3..29).contains(&x) && (3..29).contains(&y);
        let path = picture(folder.path(), 32, white)?;
        let pixels = (0..32 * 32).filter(|k| white(k % 32, k / 32)).count();
        let empty = pixels as f64 / (32.0 * 32.0);
        let flags = format!("--target {} --size 32 --triangles 60 --steps 80", path.display());
        let scaled = format!("{flags} --learning-rate 0.03 {}", tested.at(0.02));
        let mut trials = shape(tested, &scaled, 2, f64::INFINITY)?;
        trials.iter_mut().for_each(|trial| trial.value /= empty);
        Ok(Level::new(f64::from(width), with_limit(trials, 0.5)))
    };
    [1, 2, 4, 6].map(level).into_iter().collect()
}

fn dying(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const SIDE: usize = 32;
    let target = Logo::of(Variant::Original).image(SIDE);
    let scene = Scene::new(&target, &Instance::seeded(0, 80), SIDE);
    let level = |scale: f64| {
        let method = tested.method_at(scale)?;
        let descent = Descent {
            method: &method,
            faces: scene.faces(),
            size: SIDE,
            steps: 60,
            learning_rate: 0.02,
            loss: Loss::Mse,
            factor: 1.0,
        };
        let target: Tensor<Single, 3> = scene.target().inner();
        let start = scene.start().inner();
        let found = descent.run(start, &target, |theta| scene.vertices(theta), |theta| theta);
        let corners = found.last().chunks(2).map(|p| [p[0], p[1], 1.0]).collect();
        let flat = Flat::loose(corners);
        let drawn = Drawing::new(&method, &flat, SIDE).fused::<Single>();
        let still = drawn.gradient.chunks(9).filter(|face| face.iter().all(|&g| g == 0.0)).count();
        let share = still as f64 / flat.faces.len() as f64;
        Ok(Level::new(scale, vec![Trial::at_most(share, 0.02).with(&found.numbers)]))
    };
    [1e-4, 1e-3, 1e-2, 1e-1].map(level).into_iter().collect()
}

fn counts(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |count: u32| {
        let flags = format!("--size 32 --steps 60 --triangles {count} --learning-rate 0.03");
        let trials = shape(tested, &format!("{flags} {}", tested.at(0.02)), 2, 0.1)?;
        Ok(Level::new(f64::from(count), trials))
    };
    [8, 32, 128, 512].map(level).into_iter().collect()
}

fn rates(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |rate: f64| {
        let flags = format!("--size 32 --steps 60 --triangles 80 --learning-rate {rate}");
        Ok(Level::new(rate, shape(tested, &format!("{flags} {}", tested.at(0.02)), 2, 0.1)?))
    };
    [1e-4, 1e-3, 1e-2, 3e-2, 0.1, 1.0].map(level).into_iter().collect()
}

fn scales(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let flags = "--size 32 --steps 40 --triangles 80 --learning-rate 0.03";
        Ok(Level::new(scale, shape(tested, &format!("{flags} {}", tested.at(scale)), 1, 0.1)?))
    };
    [1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e3].map(level).into_iter().collect()
}

fn no_shape(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    // Name, size of the image, which pixels are white.
    type Target = (&'static str, u32, fn(u32, u32) -> bool);
    let levels: [Target; 4] = [
        ("black", 16, |_, _| false),
        ("white", 16, |_, _| true),
        ("one pixel", 16, |x, y| (x, y) == (5, 9)),
        ("image of one pixel", 1, |x, _| x < 8),
    ];
    let level = |(name, size, white): Target| {
        let folder = tempfile::tempdir()?;
        let path = picture(folder.path(), 16, white)?;
        let flags = format!("--size {size} --triangles 20 --steps 20 --learning-rate 0.1");
        let flags = format!("{flags} --target {}", path.display());
        let warned = tested.solve::<Shape2d>(&flags, 1)?.iter().all(|run| !run.warnings.is_empty());
        let told = warned || !["black", "white"].contains(&name);
        let trials = shape(tested, &flags, 1, f64::INFINITY)?.into_iter().map(|trial| Trial {
            value: f64::from(u8::from(!(trial.finite && told))),
            reached: trial.finite && told,
            ..trial
        });
        Ok(Level::named(name, trials.collect()))
    };
    levels.map(level).into_iter().collect()
}

fn airplane(tested: &Tested, flags: &str, runs: usize, limit: f64) -> anyhow::Result<Vec<Trial>> {
    let folder = tempfile::tempdir()?;
    let sphere = folder.path().join("sphere.obj");
    icosphere(1).write_obj(&sphere)?;
    let flags = format!("--size 24 --template {} {flags}", sphere.display());
    let hard = trials::<Shape3d>(tested, &flags, runs, |run| {
        end(run).map_or(f64::NAN, |end| end.extra[0])
    });
    Ok(with_limit(hard?, limit))
}

fn elevations(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let trials = airplane(tested, &format!("--steps 30 {}", tested.at(0.01)), 5, 0.5)?;
    let level = |(trial, elevation): (Trial, f64)| Level::new(elevation, vec![trial]);
    Ok(trials.into_iter().zip([30.0, 60.0, 0.0, -30.0, -60.0]).map(level).collect())
}

fn softness(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let trials = airplane(tested, &format!("--steps 20 {}", tested.at(scale)), 1, 0.6)?;
        Ok(Level::new(scale, trials))
    };
    [1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0].map(level).into_iter().collect()
}
