//! What is tested, one file for each part of a rasterizer or task.

mod corners;
mod depths;
mod faces;
mod gradients;
mod learning;
mod many;
mod numbers;
mod poses;
mod shapes;

use std::{path::Path, sync::Arc};

use clap::Parser;
use softrast_method::{Defaults, Method};
use softrast_raster::BackendChoice;
use softrast_runner::{Schedule, Settings};

use crate::{
    Case, Level, Tested, Trial,
    drawn::{Drawing, Exact, Painter, Single, weights},
    flat::Flat,
};

/// Softness, in NDC, of cases that do not vary it.
const SCALE: f64 = 0.03;
/// Width and height of small images.
const SIZE: usize = 16;

/// All cases, in the order of the report.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    let parts = [
        faces::CASES,
        many::CASES,
        numbers::CASES,
        depths::CASES,
        gradients::CASES,
        corners::CASES,
        poses::CASES,
        shapes::CASES,
        learning::CASES,
    ];
    parts.into_iter().flatten()
}

/// One level for each scene: the largest error of a pixel against the definition, at most 1e-5, with
/// finite gradients in both float types.
fn against_dense<L: Into<String>>(
    tested: &Tested,
    scenes: impl IntoIterator<Item = (L, Flat)>,
) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let weights = weights(SIZE);
    let mut painters: Option<Painters> = None;
    let mut levels = Vec::new();
    for (label, flat) in scenes {
        let drawing = Drawing::new(&method, &flat, SIZE);
        // To choose the knots costs more than an image.
        let kept = painters.take().filter(|kept| kept.faces == flat.faces);
        let kept = painters.insert(kept.unwrap_or_else(|| Painters::new(&drawing)));
        let exact = kept.exact.draw(&flat, &weights);
        let single = kept.single.draw(&flat, &weights);
        let off = exact.off(&drawing.dense());
        let trial = Trial::at_most(off, 1e-5).with(&exact.all()).with(&single.all());
        levels.push(Level::named(label, vec![trial]));
    }
    Ok(levels)
}

/// What draws some faces in both float types.
struct Painters {
    faces: Arc<[[u32; 3]]>,
    exact: Painter<Exact>,
    single: Painter<Single>,
}

impl Painters {
    fn new(drawing: &Drawing) -> Self {
        let faces = drawing.flat.faces.clone();
        Self { faces, exact: drawing.painter(), single: drawing.painter() }
    }
}

/// The method of a softness file.
fn from_file(path: &Path) -> anyhow::Result<Method> {
    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: Settings,
    }
    let words = ["task".into(), "--softness".into(), path.as_os_str().to_owned()];
    let defaults = Defaults {
        task: "stability",
        schedule: Schedule::Static,
        decay: [SCALE; 2],
        fixed: SCALE,
        size: SIZE,
        backends: &[BackendChoice::NdArray],
    };
    Method::new(&Line::try_parse_from(words)?.settings, &defaults)
}
