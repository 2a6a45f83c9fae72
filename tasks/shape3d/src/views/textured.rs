//! A texture of a mesh whose colours have been found.

use softrast_inverse::{FoundTexture, baked, paint_texture};
use softrast_lab::{program::say, was_interrupted};
use softrast_mesh::Mesh;
use softrast_raster::Pinhole;
use softrast_views::{Atlas, PaintedView, textured_pixels};

/// Steps in which texels are found.
pub(super) const STEPS: usize = FoundTexture::STEPS;

/// Texels of an atlas at most: all that a texture may have.
const MOST_TEXELS: usize = FoundTexture::SIZES[1] * FoundTexture::SIZES[1];

/// The name of the material.
const MATERIAL: &str = "surface";

/// A mesh with a texture.
pub(super) struct Textured {
    pub(super) mesh: Mesh,
    atlas: Option<Atlas>,
    /// Texels a side and charts, if the texture was found and not baked.
    pub(super) found: Option<[usize; 2]>,
}

impl Textured {
    /// The texture of a mesh that these views show, from the colours of the vertices of `painted` on: the mesh, or the mesh cut finer. A mesh of so many
    /// parts that no texture has room for their margins gets those colours themselves, unless a size was asked for. Where the user stops it, it is as it was then.
    ///
    /// # Errors
    ///
    /// Errors of [`paint_texture`], and of `told` except an interrupt.
    pub(super) fn new(
        mesh: &Mesh,
        painted: &Mesh,
        views: &[PaintedView],
        size: Option<usize>,
        told: impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Self> {
        let (mesh, found) = match paint_texture(mesh, painted, views, size, told) {
            Ok(FoundTexture { stopped: Some(why), .. }) if !was_interrupted(&why) => {
                return Err(why);
            }
            Ok(FoundTexture { mesh, size, charts, stopped }) => {
                if stopped.is_some() {
                    say("stopped before the texture was done: it is as it was then");
                }
                (mesh, Some([size, charts]))
            }
            Err(why) if size.is_none() => {
                say(&format!("{why:#}: its texture shows the colours of its vertices"));
                (baked(mesh, painted)?, None)
            }
            Err(why) => return Err(why),
        };
        let (atlas, _) = Atlas::of(&mesh, MOST_TEXELS);
        Ok(Self { mesh, atlas, found })
    }

    /// Its [`textured_pixels`] in a camera.
    pub(super) fn pixels(&self, camera: &Pinhole) -> Option<[Vec<f64>; 4]> {
        self.atlas.as_ref().map(|atlas| textured_pixels(&self.mesh, atlas, camera))
    }

    /// The text of an OBJ file whose material is in the file `mtl` beside it.
    pub(super) fn obj(&self, mtl: &str) -> String {
        format!("mtllib {mtl}\nusemtl {MATERIAL}\n{}", self.mesh.to_obj())
    }

    /// The text of the MTL file, with the picture in the file `png` beside it.
    pub(super) fn mtl(png: &str) -> String {
        format!("newmtl {MATERIAL}\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {png}\n")
    }

    /// The picture of the texture, as a PNG file.
    pub(super) fn picture(&self) -> &[u8] {
        self.mesh.texture().and_then(|texture| texture.picture()).unwrap_or_default()
    }
}
