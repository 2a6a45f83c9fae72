use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};

use crate::{
    SIZE, Shapes, Split, VIEWS, Voxels,
    npz::{Element, NpzArray},
    pairs::PICTURE,
    voxels::CELLS,
};

/// Shapes in the public files of earlier papers.
///
/// A class has two files per split: `<class>_<split>_images.npz` with `[shapes, 24, 4, 64, 64]`
/// bytes (24 views of red, green, blue and alpha) and `<class>_<split>_voxels.npz` with
/// `[shapes, 32, 32, 32]` truth values. View k is taken from azimuth -15 k degrees; for the order
/// of the voxels see [`Voxels`]. Rows are read on demand.
///
/// Source: the layout of Kato et al. 2018; docs/notes.md, Reconstruction.
#[derive(Debug)]
pub struct NpzFolder {
    classes: Vec<String>,
    images: Vec<NpzArray>,
    voxels: Vec<NpzArray>,
}

impl NpzFolder {
    /// Opens the files of a split of every class in a folder.
    ///
    /// # Errors
    ///
    /// A message of one line with the missing or invalid file and the reason.
    pub fn open(folder: &Path, split: Split) -> anyhow::Result<Self> {
        let name = folder.display();
        let entries =
            fs::read_dir(folder).with_context(|| format!("cannot read the folder {name}"))?;
        let mut classes = Vec::new();
        for entry in entries {
            let file = entry?.file_name();
            // A class exists if any of its splits does; missing files are reported below.
            let class = [Split::Train, Split::Val, Split::Test].into_iter().find_map(|split| {
                let tail = format!("_{}_images.npz", split.name());
                Some(file.to_str()?.strip_suffix(&tail)?.to_owned())
            });
            classes.extend(class);
        }
        classes.sort();
        classes.dedup();
        if classes.is_empty() {
            bail!("there is no file named <class>_{}_images.npz in {name}", split.name());
        }
        let path = |class: &str, what: &str| -> anyhow::Result<PathBuf> {
            let path = folder.join(format!("{class}_{}_{what}.npz", split.name()));
            ensure!(path.is_file(), "the file {} is missing", path.display());
            Ok(path)
        };
        let (mut images, mut voxels) = (Vec::new(), Vec::new());
        for class in &classes {
            let [image_path, voxel_path] = [path(class, "images")?, path(class, "voxels")?];
            let of_class = NpzArray::open(&image_path, &[VIEWS, 4, SIZE, SIZE])?;
            ensure!(
                of_class.element() == Element::Byte,
                "cannot use {}: its elements are no bytes",
                image_path.display()
            );
            let voxels_of_class = NpzArray::open(&voxel_path, &[CELLS; 3])?;
            let [pictured, filled] = [of_class.rows(), voxels_of_class.rows()];
            ensure!(
                pictured == filled,
                "{} holds {pictured} shapes, but {} holds {filled}",
                image_path.display(),
                voxel_path.display(),
            );
            images.push(of_class);
            voxels.push(voxels_of_class);
        }
        Ok(Self { classes, images, voxels })
    }
}

impl Shapes for NpzFolder {
    fn classes(&self) -> &[String] {
        &self.classes
    }

    fn count(&self, class: usize) -> usize {
        self.images[class].rows()
    }

    fn picture(&self, class: usize, shape: usize, view: usize) -> anyhow::Result<Vec<u8>> {
        let mut planes = self.images[class].part(shape, [view, VIEWS])?;
        debug_assert_eq!(planes.len(), PICTURE);
        // Their camera axes are left-handed, which mirrors the shapes.
        planes.chunks_mut(SIZE).for_each(<[u8]>::reverse);
        Ok(planes)
    }

    fn voxels(&self, class: usize, shape: usize) -> anyhow::Result<Voxels> {
        let array = &self.voxels[class];
        let bytes = array.part(shape, [0, 1])?;
        let full = |cell: &[u8]| match cell {
            &[byte] => byte != 0,
            &[a, b, c, d] => f32::from_le_bytes([a, b, c, d]) > 0.5,
            cell => cell.try_into().is_ok_and(|cell| f64::from_le_bytes(cell) > 0.5),
        };
        let cells = bytes.chunks(array.element().bytes());
        Ok(Voxels::from_file_order(cells.map(full).collect()))
    }
}
