//! Small data sets in the public layout.

use std::{
    fs::File,
    io::Write,
    path::{Path, PathBuf},
};

use reconstruct::{Procedural, Shapes, Split, VIEWS};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// An NPY array of bytes.
pub(crate) fn npy(descr: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let head = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend((head.len() as u16).to_le_bytes());
    array.extend(head.as_bytes());
    array.extend(bytes);
    array
}

/// Writes an NPZ file of one array.
pub(crate) fn npz(path: &Path, array: &[u8], method: CompressionMethod) {
    let mut zip = ZipWriter::new(File::create(path).unwrap());
    zip.start_file("arr_0.npy", SimpleFileOptions::default().compression_method(method)).unwrap();
    zip.write_all(array).unwrap();
    zip.finish().unwrap();
}

/// Both files of a split of a class with two shapes, taken from class `of` of the procedural set.
pub(crate) fn class(folder: &Path, name: &str, of: usize, split: Split, method: CompressionMethod) {
    let shapes = Procedural::new(split, 0, 2);
    let mut images = Vec::new();
    let mut voxels = Vec::new();
    for shape in 0..2 {
        for view in 0..VIEWS {
            // Files of this layout have mirrored shapes.
            let mut planes = shapes.picture(of, shape, view).unwrap();
            planes.chunks_mut(64).for_each(<[u8]>::reverse);
            images.extend(planes);
        }
        let cells = shapes.voxels(of, shape).unwrap();
        voxels.extend(cells.in_file_order().iter().map(|&full| u8::from(full)));
    }
    npz(&path(folder, name, split, "images"), &npy("|u1", "2, 24, 4, 64, 64", &images), method);
    npz(&path(folder, name, split, "voxels"), &npy("|b1", "2, 32, 32, 32", &voxels), method);
}

/// The path of a file of a class.
pub(crate) fn path(folder: &Path, name: &str, split: Split, what: &str) -> PathBuf {
    folder.join(format!("{name}_{}_{what}.npz", split.name()))
}
