//! 2D SHAPE and 3D SHAPE: thin targets, few and many faces, extreme settings.

use image::{GrayImage, Luma};
use shape2d::{Args, Instance, Shape2d};
use shape3d::Shape3d;
use softrast_cli::{EdgeChoice, Task, Variant};
use softrast_inverse::SolveConfig;
use softrast_mesh::icosphere;

use super::common::{HARD, ORIGINAL, levels, trials, with_limit};
use crate::{
    Case, Config, Level, Tested, Trial, descend,
    drawing::{RenderRequest, Single},
    planar_scene::PlanarScene,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O10",
        name: "thin spokes",
        scene: "2D SHAPE, 60 triangles, 32 x 32, 80 steps; the target is a cross of thin bars",
        perturbation: "width of the bars, 1 to 6 pixels",
        measure: "hard error over that of an empty image",
        target: "at most 0.5",
        run: spokes,
    },
    Case {
        id: "O11",
        name: "triangles that die",
        scene: "2D SHAPE, 80 triangles, letters at 32 x 32, 60 steps without its smoothness",
        perturbation: "softness at the last step from 1e-4 to 0.1 NDC",
        measure: "share of the triangles without any gradient at the end",
        target: "at most 0.02",
        run: dying,
    },
    Case {
        id: "O12",
        name: "2D SHAPE by faces",
        scene: "2D SHAPE, letters at 32 x 32, 60 steps",
        perturbation: "8 to 512 triangles",
        measure: "hard error",
        target: "at most 0.1",
        run: counts,
    },
    Case {
        id: "O29",
        name: "2D SHAPE by learning rate",
        scene: "2D SHAPE, 80 triangles, letters at 32 x 32, 60 steps, 2 seeds",
        perturbation: "learning rate from 1e-4 to 1",
        measure: "hard error",
        target: "at most 0.1",
        run: rates,
    },
    Case {
        id: "O30",
        name: "2D SHAPE, softness from 1e-12 to 1e3",
        scene: "2D SHAPE, 80 triangles, letters at 32 x 32, 40 steps",
        perturbation: "softness from 1e-12 to 1e3 NDC",
        measure: "hard error",
        target: "at most 0.1",
        run: scales,
    },
    Case {
        id: "O15",
        name: "3D SHAPE by elevation",
        scene: "3D SHAPE, the airplane from a sphere of 80 faces, 24 views of 24 x 24, 30 steps",
        perturbation: "elevation of the cameras: 30, 60, 0, -30, -60 degrees",
        measure: "hard IoU loss",
        target: "at most 0.5",
        run: elevations,
    },
    Case {
        id: "O31",
        name: "3D SHAPE by softness",
        scene: "3D SHAPE, the airplane from a sphere of 80 faces, 24 views of 24 x 24, 20 steps",
        perturbation: "softness at the last step from 1e-6 to 1 NDC",
        measure: "hard IoU loss",
        target: "at most 0.6",
        run: softness,
    },
];

const SHAPE2D: Config =
    Config { size: 32, steps: Some(60), learning_rate: Some(0.03), runs: 2, ..ORIGINAL };

fn triangles(count: usize) -> Args {
    Args { triangles: Some(count), ..Args::default() }
}

fn shape(tested: &Tested, args: Args, config: &Config, limit: f64) -> anyhow::Result<Vec<Trial>> {
    Ok(with_limit(trials::<Shape2d>(tested, args, config, HARD)?, limit))
}

fn spokes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1, 2, 4, 6], |width: u32| {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("target.png");
        let bar = |x: u32| (16 - width.div_ceil(2)..16 + width / 2).contains(&x);
        let white =
            |x: u32, y: u32| (bar(x) || bar(y)) && (3..29).contains(&x) && (3..29).contains(&y);
        let picture = GrayImage::from_fn(32, 32, |x, y| Luma([if white(x, y) { 255 } else { 0 }]));
        picture.save(&path)?;
        let empty = picture.pixels().filter(|p| p.0[0] > 0).count() as f64 / (32.0 * 32.0);
        let args = Args { target: Some(path), ..triangles(60) };
        let config = Config { steps: Some(80), scale: Some(0.02), ..SHAPE2D };
        let mut trials = shape(tested, args, &config, f64::INFINITY)?;
        trials.iter_mut().for_each(|trial| trial.value /= empty);
        Ok(Level::new(f64::from(width), with_limit(trials, 0.5)))
    })
}

fn dying(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const SIDE: usize = 32;
    let problem = Shape2d::new(&triangles(80), Variant::Original, &EdgeChoice::default())?;
    levels([1e-4, 1e-3, 1e-2, 1e-1], |scale: f64| {
        let softness = tested.at(scale);
        let config = SolveConfig { size: SIDE, steps: 60, learning_rate: 0.02 };
        let found = descend(&problem, &[Instance::seeded(0, 80, 1)], softness.clone(), config)?;
        let corners = found.last().chunks(2).map(|p| [p[0], p[1], 1.0]).collect();
        let flat = PlanarScene::loose(corners);
        let drawn = RenderRequest::new(&softness, &flat, SIDE).fused::<Single>();
        let still = drawn.gradient.chunks(9).filter(|face| face.iter().all(|&g| g == 0.0)).count();
        let share = still as f64 / flat.faces.len() as f64;
        Ok(Level::new(scale, vec![Trial::at_most(share, 0.02).with(&found.numbers)]))
    })
}

fn counts(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([8, 32, 128, 512], |count: usize| {
        let config = Config { scale: Some(0.02), ..SHAPE2D };
        Ok(Level::new(count as f64, shape(tested, triangles(count), &config, 0.1)?))
    })
}

fn rates(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-4, 1e-3, 1e-2, 3e-2, 0.1, 1.0], |rate: f64| {
        let config = Config { learning_rate: Some(rate), scale: Some(0.02), ..SHAPE2D };
        Ok(Level::new(rate, shape(tested, triangles(80), &config, 0.1)?))
    })
}

fn scales(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e3], |scale: f64| {
        let config = Config { steps: Some(40), scale: Some(scale), runs: 1, ..SHAPE2D };
        Ok(Level::new(scale, shape(tested, triangles(80), &config, 0.1)?))
    })
}

fn airplane(tested: &Tested, config: Config, limit: f64) -> anyhow::Result<Vec<Trial>> {
    let folder = tempfile::tempdir()?;
    let sphere = folder.path().join("sphere.obj");
    icosphere(1).save(&sphere)?;
    let args = shape3d::Args { template: Some(sphere), ..shape3d::Args::default() };
    Ok(with_limit(trials::<Shape3d>(tested, args, &config, HARD)?, limit))
}

fn elevations(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let config = Config { size: 24, steps: Some(30), scale: Some(0.01), runs: 5, ..ORIGINAL };
    let trials = airplane(tested, config, 0.5)?;
    let level = |(trial, elevation): (Trial, f64)| Level::new(elevation, vec![trial]);
    Ok(trials.into_iter().zip([30.0, 60.0, 0.0, -30.0, -60.0]).map(level).collect())
}

fn softness(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0], |scale: f64| {
        let config = Config { size: 24, steps: Some(20), scale: Some(scale), runs: 1, ..ORIGINAL };
        Ok(Level::new(scale, airplane(tested, config, 0.6)?))
    })
}
