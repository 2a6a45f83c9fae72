use softrast_inverse::{
    InverseProblem, Minimization, PoseProblem, SolveConfig, pose::PoseInstance,
};
use softrast_mesh::Mesh;
use softrast_raster::{HostBackend, RasterBackend, view_rotation};
use softrast_tensor::{numbers, vector};

use crate::{CameraView, Coming, Frame, Run, Settings};

/// POSE: finds the camera of a seeded target.
pub struct PoseRun<B: RasterBackend> {
    run: Minimization<PoseProblem, B>,
    instance: PoseInstance,
    config: SolveConfig,
}

impl<B: RasterBackend> PoseRun<B> {
    /// The run of a seed, before its first step.
    ///
    /// # Errors
    ///
    /// If the softness is invalid.
    pub fn new(mesh: &Mesh, settings: &Settings) -> anyhow::Result<Self> {
        let problem = PoseProblem::new(mesh);
        let (method, config) = settings.method("pose", problem.defaults().learning_rate)?;
        let instance = problem.instance(settings.seed.into())?;
        let run = Minimization::new(problem, vec![instance], &method, &config)?.with_pictures();
        Ok(Self { run, instance, config })
    }

    /// Vertices along the axes of the target camera, flat: in this frame the camera is at elevation 0 and azimuth 0.
    pub fn turned(&self, mesh: &Mesh) -> Vec<f32> {
        let target = self.instance.target;
        let of = |angle: f64| vector::<HostBackend>(&[angle]);
        let r = numbers(view_rotation(of(target.elevation_deg), of(target.azimuth_deg)));
        let turned = |p: &[f64; 3]| {
            [0, 1, 2].map(|i| (0..3).map(|k| r[3 * i + k] * p[k]).sum::<f64>() as f32)
        };
        mesh.positions().iter().flat_map(turned).collect()
    }

    fn target_camera(&self) -> CameraView {
        CameraView::orbiting([self.instance.target.distance, 0.0, 0.0])
    }
}

impl<B: RasterBackend> Run for PoseRun<B> {
    fn size(&self) -> usize {
        self.config.size
    }

    fn steps(&self) -> usize {
        self.config.steps
    }

    fn target(&self) -> Vec<f64> {
        numbers(self.run.scene().target())
    }

    fn truth(&self) -> Option<CameraView> {
        Some(self.target_camera())
    }

    fn next_async(&mut self) -> Coming<'_> {
        Box::pin(async move {
            let Some(iterate) = self.run.next_async().await.transpose()? else { return Ok(None) };
            let hard = self.run.problem().hard_image(self.run.scene(), iterate.theta.clone());
            let theta = numbers(iterate.theta.clone());
            let camera = CameraView::orbiting([theta[0], theta[1], theta[2]]);
            let angle_deg = Some(camera.angle_deg(&self.target_camera()));
            Ok(Some(Frame {
                angle_deg,
                camera: Some(camera),
                ..Frame::new(&iterate, &numbers(hard), theta)
            }))
        })
    }
}
