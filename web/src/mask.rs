use anyhow::Context;
use softrast_inverse::{
    InverseProblem, Method, Minimization, SolveConfig,
    pose::{MaskPose, MaskPoses, PoseSearch},
};
use softrast_mesh::Mesh;
use softrast_raster::{Pinhole, RasterBackend};
use softrast_tensor::numbers;
use softrast_views::{Lens, Picture};

use crate::{Backend, CameraView, Coming, Frame, Run, Settings};

/// Field of view along the shorter side of a mask, in degrees: the lens is unknown.
const ASSUMED_FOV_DEG: f64 = 45.0;
/// Most starts.
const STARTS: usize = 3;

/// POSE from a mask: a search over all directions and rolls, on the CPU, then optimisation from the
/// best starts, one after the other.
pub struct MaskRun<B: RasterBackend> {
    mesh: Mesh,
    mask: Picture,
    camera: Pinhole,
    square: [f64; 3],
    method: Method,
    /// Settings of the run from each start.
    config: SolveConfig,
    starts: Vec<Pinhole>,
    /// Number of the current start, counted from 0.
    start: usize,
    run: Option<(Minimization<MaskPoses, B>, MaskPose)>,
    /// The frame with the smallest error so far.
    best: Option<Frame>,
    step: usize,
}

impl<B: RasterBackend> MaskRun<B> {
    /// The run for a mask of any size, before its first step.
    ///
    /// # Errors
    ///
    /// If the mask is empty or full, the mesh has no extent, or the softness is invalid.
    pub fn new(mesh: &Mesh, mask: Picture, settings: &Settings) -> anyhow::Result<Self> {
        let camera = Lens::of_fov(ASSUMED_FOV_DEG, mask.size()).pinhole(mask.size())?;
        PoseSearch::new(mesh, camera).check(&mask)?;
        let (method, config) = settings.method("mask", PoseSearch::LEARNING_RATE / 3.0)?;
        let square = mask.view_square()?;
        Ok(Self {
            mesh: mesh.clone(),
            mask,
            camera,
            square,
            method,
            config,
            starts: vec![],
            start: 0,
            run: None,
            best: None,
            step: 0,
        })
    }

    /// Starts from the next start pose, if there is one.
    fn begin(&mut self) -> anyhow::Result<()> {
        let Some(&start) = self.starts.get(self.start) else { return Ok(()) };
        let pose = MaskPose { mask: self.mask.clone(), square: self.square, start, painted: None };
        let problem = MaskPoses::new(&self.mesh, vec![pose.clone()]);
        let run = Minimization::new(problem, vec![pose.clone()], &self.method, &self.config)?
            .with_pictures();
        self.run = Some((run, pose));
        Ok(())
    }
}

impl<B: RasterBackend> Run for MaskRun<B> {
    fn size(&self) -> usize {
        self.config.size
    }

    fn steps(&self) -> usize {
        let each = self.config.steps + 1;
        each * self.starts.len().max(1)
    }

    fn target(&self) -> Vec<f64> {
        let [levels, _] = self.mask.part(self.square, self.config.size);
        levels
    }

    fn prepare(&mut self, told: &mut dyn FnMut(f64)) -> anyhow::Result<()> {
        // An adaptive schedule solves one instance at a time; here there are many, at low resolution.
        let mut method = self.method.clone();
        method.softness.adaptive = None;
        told(0.0);
        let steps = PoseSearch::steps_of_starts(&self.mask) as f64;
        let search = PoseSearch::new(&self.mesh, self.camera).with_method(method);
        let search = search.progress(|step, _| {
            told(step as f64 / steps);
            Ok(())
        });
        let starts = search.starts::<Backend>(&self.mask)?;
        self.starts = starts.into_iter().take(STARTS).collect();
        self.begin()
    }

    /// The last frame repeats the best one.
    fn next_async(&mut self) -> Coming<'_> {
        Box::pin(async move {
            let Some((run, pose)) = &mut self.run else { return Ok(None) };
            let Some(iterate) = run.next_async().await.transpose()? else {
                self.start += 1;
                self.run = None;
                self.begin()?;
                return match &self.run {
                    Some(_) => self.next_async().await,
                    None => Ok(self.best.take().map(|best| Frame { step: self.step, ..best })),
                };
            };
            let hard = run.problem().hard_image(run.scene(), iterate.theta.clone());
            let cameras = run.scene().found(iterate.theta.clone(), std::slice::from_ref(pose));
            let camera = cameras.first().context("a pose has a camera")?;
            let [down, ahead] = [1, 2].map(|row| camera.rotation[row]);
            let view = CameraView { eye: camera.eye(), ahead, up: down.map(|x| -x) };
            let frame = Frame {
                step: self.step,
                camera: Some(view),
                start: [self.start, self.starts.len()],
                ..Frame::new(&iterate, &numbers(hard), numbers(iterate.theta.clone()))
            };
            self.step += 1;
            if self.best.as_ref().is_none_or(|best| frame.hard_loss < best.hard_loss) {
                self.best = Some(frame.clone());
            }
            Ok(Some(frame))
        })
    }
}
