use std::sync::Arc;

use anyhow::Context;
use burn::tensor::{DType, Tensor, TensorData, backend::Backend};
use softrast_mesh::Mesh;
use softrast_raster::TConorm;
use softrast_runner::Error;
use softrast_softness::{EdgeSoftness, ScheduledSoftness, Softness};

use crate::args::{Args, Choice};

/// Everything that a measurement needs, in plain numbers.
pub(crate) struct Scene {
    pub(crate) faces: Arc<[[u32; 3]]>,
    /// `[vertices, 3]`, world units.
    pub(crate) vertices: Vec<f64>,
    /// `[views, 4]`, as `softrast_raster::project` takes them.
    pub(crate) orbits: Vec<f64>,
    pub(crate) size: usize,
    pub(crate) softness: EdgeSoftness,
    pub(crate) phi: Vec<f64>,
    pub(crate) t_conorm: TConorm,
    pub(crate) tolerance: f64,
    /// `[size, size]`, top row first.
    pub(crate) target: Option<Vec<f64>>,
}

/// Scale of the logistic that rises from 10 % to 90 % within half a pixel, in pixels.
const HALF_PIXEL: f64 = 0.5 / 4.4;

impl Scene {
    /// Reads the files that `args` names.
    pub(crate) fn load(args: &Args) -> anyhow::Result<Self> {
        let (softness, phi) = softness(args)?;
        let mesh = Mesh::load(&args.mesh)?;
        let mesh = if args.raw { mesh } else { mesh.normalized() };
        let target = args.target.as_ref().map(|target| target.pixels(args.size)).transpose()?;
        let orbit = |&azimuth: &f64| [args.distance, args.elevation, azimuth, args.fov / 2.0];
        Ok(Self {
            faces: mesh.faces().into(),
            vertices: mesh.positions().as_flattened().to_vec(),
            orbits: args.azimuths.iter().flat_map(orbit).collect(),
            size: args.size,
            softness,
            phi,
            t_conorm: args.t_conorm,
            tolerance: args.tolerance,
            target,
        })
    }

    /// Number of views.
    pub(crate) fn views(&self) -> usize {
        self.orbits.len() / 4
    }

    /// The vertices `[1, vertices, 3]`, shared by all views.
    pub(crate) fn vertices<B: Backend>(&self, dtype: DType) -> Tensor<B, 3> {
        tensor(&self.vertices, [1, self.vertices.len() / 3, 3], dtype)
    }

    /// The cameras `[views, 4]`.
    pub(crate) fn orbits<B: Backend>(&self, dtype: DType) -> Tensor<B, 2> {
        tensor(&self.orbits, [self.views(), 4], dtype)
    }

    /// Parameters of the softness.
    pub(crate) fn phi<B: Backend>(&self, dtype: DType) -> Tensor<B, 1> {
        tensor(&self.phi, [self.phi.len()], dtype)
    }

    /// The target, once for each view: `[views, size, size]`.
    pub(crate) fn target<B: Backend>(&self, dtype: DType) -> Option<Tensor<B, 3>> {
        let one = tensor(self.target.as_ref()?, [1, self.size, self.size], dtype);
        Some(one.expand([self.views(), self.size, self.size]))
    }
}

fn tensor<B: Backend, const D: usize>(
    values: &[f64],
    shape: [usize; D],
    dtype: DType,
) -> Tensor<B, D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), (&Default::default(), dtype))
}

fn softness(args: &Args) -> anyhow::Result<(EdgeSoftness, Vec<f64>)> {
    match &args.softness {
        Choice::File(_) if args.scale.is_some() || args.squared => Err(Error::Usage(
            "--scale and --squared are for a named softness: a file has its own".into(),
        )
        .into()),
        Choice::File(path) => {
            let file = ScheduledSoftness::load(path).context("--softness")?;
            Ok((file.softness, file.phi))
        }
        &Choice::Named(family) => {
            let softness = EdgeSoftness { family, squared: args.squared };
            let narrow = HALF_PIXEL * 2.0 / args.size as f64;
            let scale = args.scale.unwrap_or(if args.squared { narrow * narrow } else { narrow });
            Ok((softness, softness.default_phi(scale)))
        }
    }
}
