//! The scenes of the benchmarks.

use std::{env, path::Path, sync::Arc};

use softrast_mesh::{Mesh, fox, icosphere};
use softrast_raster::{
    RasterBackend,
    low_level::{Rasterizer, Silhouette},
    project,
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Backend, DType, Tensor, TensorData};

/// A logistic of the signed squared distance: `width` is the root of its scale, in NDC.
pub(crate) const SOFTNESS: EdgeSoftness = EdgeSoftness::squared(Family::Logistic);

/// A mesh, its views and the width of its softness.
pub(crate) struct Workload {
    pub(crate) name: String,
    pub(crate) faces: Arc<[[u32; 3]]>,
    /// `[vertices, 3]`, world units.
    pub(crate) vertices: Vec<f64>,
    /// `[views, 4]`.
    pub(crate) orbits: Vec<f64>,
    pub(crate) size: usize,
    pub(crate) width: f64,
    pub(crate) softness: EdgeSoftness,
}

impl Workload {
    /// A mesh seen from 2.732 away with a field of view of 60 degrees, at width 1e-2.
    pub(crate) fn new(name: &str, mesh: &Mesh, azimuths: &[f64], size: usize) -> Self {
        let orbit = |&azimuth: &f64| [2.732, 0.0, azimuth, 60.0];
        Self {
            name: name.to_owned(),
            faces: mesh.faces().into(),
            vertices: mesh.positions().as_flattened().to_vec(),
            orbits: azimuths.iter().flat_map(orbit).collect(),
            size,
            width: 1e-2,
            softness: SOFTNESS,
        }
    }

    /// A sphere of 1,280 faces in 24 views of 64 x 64.
    pub(crate) fn w1() -> Self {
        let azimuths: Vec<f64> = (0..24).map(|k| 15.0 * f64::from(k)).collect();
        let sphere = known("sphere_642.obj").unwrap_or_else(|| icosphere(3));
        Self::new("W1 (sphere, 24 views of 64 px)", &sphere, &azimuths, 64)
    }

    /// A cow of 5,856 faces in one view of 256 x 256; if its file is missing, our fox of 2,856.
    pub(crate) fn w2() -> Self {
        match known("spot.obj") {
            Some(spot) => Self::new("W2 (spot, 256 px)", &spot, &[180.0], 256),
            None => Self::new("W2 (fox for spot, 256 px)", &fox(), &[180.0], 256),
        }
    }

    /// A sphere of 20,480 faces in one view of 1024 x 1024.
    pub(crate) fn w4() -> Self {
        Self::new("W4 (sphere of 20,480 faces, 1024 px)", &icosphere(5), &[30.0], 1024)
    }

    /// A sphere of 1,310,720 faces in one view of 1024 x 1024, at a width of half a pixel.
    pub(crate) fn w5() -> Self {
        let name = "W5 (sphere of 1,310,720 faces, 1024 px, half a pixel)";
        Self { width: 1.0 / 1024.0, ..Self::new(name, &icosphere(8), &[30.0], 1024) }
    }

    /// World vertices `[1, vertices, 3]`.
    pub(crate) fn world<B: Backend>(&self, dtype: DType) -> Tensor<B, 3> {
        tensor(&self.vertices, [1, self.vertices.len() / 3, 3], dtype)
    }

    /// Cameras `[views, 4]`.
    pub(crate) fn cameras<B: Backend>(&self, dtype: DType) -> Tensor<B, 2> {
        tensor(&self.orbits, [self.orbits.len() / 4, 4], dtype)
    }

    /// Vertices as inputs of the op, `[views, vertices, 3]`.
    pub(crate) fn projected<B: RasterBackend>(&self, dtype: DType) -> Tensor<B, 3> {
        project(self.world(dtype), self.cameras(dtype)).tensor()
    }

    /// Parameters of the softness.
    pub(crate) fn phi<B: Backend>(&self, dtype: DType) -> Tensor<B, 1> {
        let phi = self.softness.default_phi(self.width * self.width);
        tensor(&phi, [phi.len()], dtype)
    }

    /// The silhouette and its table for a tolerance.
    pub(crate) fn prepare<B: RasterBackend>(
        &self,
        tolerance: f64,
        dtype: DType,
    ) -> (Silhouette<EdgeSoftness>, Tensor<B, 2>) {
        let rasterizer = Rasterizer { tolerance, ..Rasterizer::new(self.size) };
        let silhouette = rasterizer.prepare(&self.faces, self.softness, &self.phi::<B>(dtype));
        let table = silhouette.table(self.phi(dtype));
        (silhouette, table)
    }
}

/// A tensor of `values`.
pub(crate) fn tensor<B: Backend, const D: usize>(
    values: &[f64],
    shape: [usize; D],
    dtype: DType,
) -> Tensor<B, D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), (&Default::default(), dtype))
}

/// A disk of radius 0.5 at (0.1, 0.05), hard-edged at pixel centres.
pub(crate) fn disk(size: usize) -> Vec<f64> {
    let centre = |index: usize| (2.0 * index as f64 + 1.0 - size as f64) / size as f64;
    let covered = |pixel: usize| {
        let (x, y) = (centre(pixel % size) - 0.1, centre(size - 1 - pixel / size) - 0.05);
        f64::from(u8::from(x * x + y * y <= 0.25))
    };
    (0..size * size).map(covered).collect()
}

/// A well-known mesh that is not part of this repository, from the folder that `SOFTRAST_MESHES` names.
fn known(file: &str) -> Option<Mesh> {
    let folder = env::var_os("SOFTRAST_MESHES")?;
    let mesh = Mesh::load(Path::new(&folder).join("paper").join(file)).ok();
    if mesh.is_none() {
        println!("there is no paper/{file} in {folder:?}; a mesh like it stands in");
    }
    mesh
}
