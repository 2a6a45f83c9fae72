//! Functions for the page's worker. Structured results are JSON, pictures bytes, errors one line of text.

use std::cell::RefCell;

use serde_json::json;
use softrast_mesh::{Mesh, fox};
use softrast_raster::RasterBackend;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::{
    Backend, Frame, Gpu, MaskRun, Playground, PoseRun, Run, Scene, Settings, ShapeRun,
    SoftnessChoice, curves, frame::bytes, loaded, luminance, mask,
};

thread_local! {
    static FAULT: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Stores the message of a panic, which a browser shows only as `unreachable`.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| {
        FAULT.with(|fault| *fault.borrow_mut() = panic.to_string().replace('\n', " "));
    }));
}

/// The message of the latest panic.
#[wasm_bindgen]
pub fn fault() -> String {
    FAULT.with(|fault| fault.borrow().clone())
}

/// Initializes the GPU, before the first run on it. Panics if the browser has no adapter.
#[cfg(target_family = "wasm")]
#[wasm_bindgen]
pub async fn set_up_gpu() {
    use softrast_tensor::wgpu::{AutoGraphicsApi, WgpuDevice, init_setup_async};
    init_setup_async::<AutoGraphicsApi>(&WgpuDevice::default(), Default::default()).await;
}

/// Names of softnesses, as JSON: `preset`, `families` and `learned`.
#[wasm_bindgen]
pub fn names() -> String {
    let [preset, families, learned] = SoftnessChoice::names();
    json!({ "preset": preset, "families": families, "learned": learned }).to_string()
}

/// The curve of a softness at `progress` of a run, on images of `size` pixels, as JSON: `curves` (of the softness, and of its surrogate, if
/// any, at `count` distances from `-reach` to `reach` in NDC), `width` in NDC, `scale`, `moves`, `adaptive`, `family` and `note`.
#[wasm_bindgen]
pub fn curve(
    choice: &str,
    task: &str,
    progress: f64,
    size: usize,
    reach: f64,
    count: usize,
) -> Result<String, String> {
    let choice: SoftnessChoice = serde_json::from_str(choice).map_err(|e| e.to_string())?;
    let softness = choice.of_task(task).map_err(line)?;
    let progress = progress.clamp(0.0, 1.0);
    let values = curves(&softness, progress, size, reach, count);
    let curves: Vec<&[f32]> = values.chunks(count).collect();
    let (width, scale) = (softness.width_at(progress, size), softness.scale_at(progress, size));
    let told = json!({
        "curves": curves, "width": width, "scale": scale, "moves": !softness.is_constant(),
        "adaptive": softness.adaptive.is_some(), "family": softness.softness.family, "note": softness.note,
    });
    Ok(told.to_string())
}

/// The file of a softness, in the format of other programs.
#[wasm_bindgen]
pub fn softness_file(choice: &str, task: &str) -> Result<String, String> {
    let choice: SoftnessChoice = serde_json::from_str(choice).map_err(|e| e.to_string())?;
    choice.of_task(task).map_err(line)?.text(&choice.name).map_err(|e| e.to_string())
}

/// A mesh for the runs.
#[wasm_bindgen]
pub struct PageMesh {
    mesh: Mesh,
    faces: usize,
}

#[wasm_bindgen]
impl PageMesh {
    /// The fox.
    pub fn fox() -> Self {
        let mesh = fox();
        Self { faces: mesh.faces().len(), mesh }
    }

    /// The mesh in the bytes of a file of this name.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self, String> {
        loaded(bytes, name).map(|of| Self { mesh: of.mesh, faces: of.faces }).map_err(line)
    }

    /// Faces of the file, which may be more than those of the mesh.
    pub fn file_faces(&self) -> usize {
        self.faces
    }

    /// Vertices, `[vertices * 3]`.
    pub fn positions(&self) -> Vec<f32> {
        self.mesh.positions().iter().flatten().map(|&x| x as f32).collect()
    }

    /// Corners of the faces as vertex numbers, `[faces * 3]`.
    pub fn faces(&self) -> Vec<u32> {
        self.mesh.faces().as_flattened().to_vec()
    }
}

/// A run of a task, on a GPU if `gpu`.
#[wasm_bindgen]
pub struct PageRun {
    run: Box<dyn Run>,
    positions: Vec<f32>,
    frame: Option<Frame>,
}

#[wasm_bindgen]
impl PageRun {
    /// POSE with a seeded target.
    pub fn pose(mesh: &PageMesh, settings: &str, gpu: bool) -> Result<Self, String> {
        fn run<B: RasterBackend>(mesh: &Mesh, settings: &Settings) -> anyhow::Result<PageRun> {
            let run = PoseRun::<B>::new(mesh, settings)?;
            let positions = run.turned(mesh);
            Ok(PageRun::new(run, positions))
        }
        let settings = Settings::parse(settings).map_err(line)?;
        if gpu { run::<Gpu>(&mesh.mesh, &settings) } else { run::<Backend>(&mesh.mesh, &settings) }
            .map_err(line)
    }

    /// POSE from a picture of `[height, width, 4]` bytes, whose transparency or luminance is the mask.
    pub fn mask(
        mesh: &PageMesh,
        rgba: &[u8],
        width: usize,
        invert: bool,
        settings: &str,
        gpu: bool,
    ) -> Result<Self, String> {
        let settings = Settings::parse(settings).map_err(line)?;
        let picture = mask(rgba, width);
        let picture = if invert { picture.inverted() } else { picture };
        let (of, positions) = (&mesh.mesh, mesh.positions());
        Ok(match gpu {
            true => {
                Self::new(MaskRun::<Gpu>::new(of, picture, &settings).map_err(line)?, positions)
            }
            false => {
                Self::new(MaskRun::<Backend>::new(of, picture, &settings).map_err(line)?, positions)
            }
        })
    }

    /// 2D SHAPE on a picture of `[height, width, 4]` bytes.
    pub fn shape(
        rgba: &[u8],
        width: usize,
        invert: bool,
        settings: &str,
        gpu: bool,
    ) -> Result<Self, String> {
        let settings = Settings::parse(settings).map_err(line)?;
        let picture = luminance(rgba, width);
        let picture = if invert { picture.inverted() } else { picture };
        Ok(match gpu {
            true => Self::new(ShapeRun::<Gpu>::new(picture, &settings).map_err(line)?, vec![]),
            false => Self::new(ShapeRun::<Backend>::new(picture, &settings).map_err(line)?, vec![]),
        })
    }

    /// Prepares the first step; calls `told` with the share that is done, 0 to 1.
    pub fn prepare(&mut self, told: &js_sys::Function) -> Result<(), String> {
        let mut tell = |share: f64| {
            // Errors of the callback are ignored.
            let _ = told.call1(&wasm_bindgen::JsValue::NULL, &share.into());
        };
        self.run.prepare(&mut tell).map_err(line)
    }

    /// The next frame as JSON; `None` after the last. Its pictures are [`PageRun::soft`] and [`PageRun::hard`].
    pub async fn next(&mut self) -> Result<Option<String>, String> {
        self.frame = self.run.next_async().await.map_err(line)?;
        self.frame
            .as_ref()
            .map(|frame| serde_json::to_string(frame).map_err(|e| e.to_string()))
            .transpose()
    }

    /// The soft image of the latest frame, `[size * size]`.
    pub fn soft(&self) -> Vec<u8> {
        self.frame.as_ref().map(|frame| frame.soft.clone()).unwrap_or_default()
    }

    /// The hard image of the latest frame, `[size * size]`.
    pub fn hard(&self) -> Vec<u8> {
        self.frame.as_ref().map(|frame| frame.hard.clone()).unwrap_or_default()
    }

    /// The target image, `[size * size]`.
    pub fn target(&self) -> Vec<u8> {
        bytes(&self.run.target())
    }

    /// Vertices in the frame of the cameras in frames, `[vertices * 3]`.
    pub fn positions(&self) -> Vec<f32> {
        self.positions.clone()
    }

    /// Size, steps and the camera of the target as JSON.
    pub fn about(&self) -> String {
        json!({ "size": self.run.size(), "steps": self.run.steps(), "truth": self.run.truth() })
            .to_string()
    }
}

impl PageRun {
    fn new(run: impl Run + 'static, positions: Vec<f32>) -> Self {
        Self { run: Box::new(run), positions, frame: None }
    }
}

/// Triangles and the gradients of pixels.
#[wasm_bindgen]
#[derive(Default)]
pub struct PagePlayground {
    playground: Playground,
    gradient: Vec<f32>,
}

#[wasm_bindgen]
impl PagePlayground {
    /// An empty playground.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// The soft picture of a [`Scene`] in JSON, `[size * size]`.
    pub fn draw(&mut self, scene: &str) -> Result<Vec<f32>, String> {
        let scene: Scene = serde_json::from_str(scene).map_err(|e| e.to_string())?;
        let field = self.playground.draw(&scene).map_err(line)?;
        self.gradient = field.gradient;
        Ok(field.image)
    }

    /// Derivatives of the last drawn picture, `[grid * grid, triangles, 3, 2]`.
    pub fn gradient(&mut self) -> Vec<f32> {
        std::mem::take(&mut self.gradient)
    }
}

/// An error with its causes, on one line.
fn line(error: anyhow::Error) -> String {
    format!("{error:#}").replace('\n', " ")
}
