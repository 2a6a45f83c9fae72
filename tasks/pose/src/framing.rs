use softrast_mesh::{Mesh, fox, painted_fox};
use softrast_raster::Pinhole;

use crate::{Args, Instances};

/// The mesh to view and its name.
pub(crate) fn mesh(args: &Args) -> anyhow::Result<(Mesh, String, Framing)> {
    let (mesh, name) = match &args.mesh {
        None if args.colour => (painted_fox(), "fox".to_owned()),
        None => (fox(), "fox".to_owned()),
        Some(path) => (Mesh::load(path)?, path.display().to_string()),
    };
    // The released pairs belong to the released meshes.
    let as_it_stands = args.raw || args.instances == Instances::Released24;
    Ok(if as_it_stands || args.mesh.is_none() {
        (mesh, name, Framing { middle: [0.0; 3], scale: 1.0 })
    } else {
        let framing = Framing::normalizing(&mesh);
        (mesh.normalized(), format!("{name}, normalized"), framing)
    })
}

/// How the mesh was moved from where it is in its file.
pub(crate) struct Framing {
    /// What came to the origin.
    pub(crate) middle: [f64; 3],
    /// By how much it grew then.
    pub(crate) scale: f64,
}

impl Framing {
    /// That of [`Mesh::normalized`].
    fn normalizing(mesh: &Mesh) -> Self {
        let [low, high] = mesh.bounds();
        let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let middle = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
        Self { middle, scale: if longest > 0.0 { 2.0 / longest } else { 1.0 } }
    }

    /// The camera for the mesh as it is in its file.
    pub(crate) fn of_file(&self, camera: &Pinhole) -> Pinhole {
        let turned =
            camera.rotation.map(|row| (0..3).map(|k| row[k] * self.middle[k]).sum::<f64>());
        let translation = [0, 1, 2].map(|k| camera.translation[k] / self.scale - turned[k]);
        Pinhole { translation, ..*camera }
    }
}
