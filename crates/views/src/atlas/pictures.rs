//! The decoded pictures of a texture.

use std::collections::HashMap;

use anyhow::Error;
use image::RgbImage;
use softrast_mesh::Texture;

use crate::PictureFile;

/// The texels of the pictures of a texture.
pub(super) struct Pictures {
    /// By the address of their files in memory, so that each is decoded once.
    of_files: HashMap<*const u8, Option<RgbImage>>,
    of_materials: Vec<Option<*const u8>>,
}

impl Pictures {
    /// Pictures that are not decoded yet.
    pub(super) fn of(texture: &Texture) -> Self {
        let mut is_used = vec![false; texture.materials().len()];
        texture.of_faces().iter().for_each(|&number| is_used[number as usize] = true);
        let key = |(material, used): (&softrast_mesh::Material, bool)| {
            material.picture().filter(|_| used).map(<[u8]>::as_ptr)
        };
        let of_materials = texture.materials().iter().zip(is_used).map(key).collect();
        Self { of_files: HashMap::new(), of_materials }
    }

    /// Decodes pictures again: at most `most` texels in total, and at most `limit` of its current number of texels for each.
    pub(super) fn reduce(
        &mut self,
        texture: &Texture,
        most: usize,
        limit: impl Fn(f64) -> f64,
    ) -> Vec<Error> {
        let mut errors = vec![];
        let mut done = HashMap::new();
        let of_materials = self.of_materials.iter().zip(texture.materials());
        let mut files: Vec<_> =
            of_materials.filter_map(|(key, it)| key.zip(it.picture())).collect();
        files.sort_unstable();
        files.dedup();
        let each = (most / files.len().max(1)).max(1);
        for (key, file) in files {
            let known = self.of_files.get(&key);
            let texels = match known {
                Some(None) => {
                    done.insert(key, None);
                    continue;
                }
                Some(Some(now)) => (limit(f64::from(now.width() * now.height())) as usize).max(1),
                None => each,
            };
            let decoded = PictureFile::decode(file).map(|file| file.texels(texels.min(each)));
            done.insert(key, decoded.map_err(|error| errors.push(error)).ok());
        }
        self.of_files = done;
        errors
    }

    pub(super) fn of_material(&self, number: usize) -> Option<&RgbImage> {
        self.of_files.get(&self.of_materials[number]?)?.as_ref()
    }
}
