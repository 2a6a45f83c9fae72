//! Workloads with known exact results, every pixel-face pair evaluated in f64.

use softrast_mesh::{airplane, chair, fox, icosphere};

use super::{
    paper_mesh::paper_mesh,
    workload::{Row, Workload},
};

/// A workload and its result.
#[derive(Clone, Debug)]
pub struct KnownRow {
    /// The name on the command line.
    pub name: &'static str,
    /// The workload.
    pub workload: Workload,
    /// Its exact result.
    pub row: Row,
}

impl KnownRow {
    /// Meshes of this repository. The numbers are results of `cargo bench -p softrast-tests --bench exact_row -- NAME reference`.
    pub fn ours() -> [Self; 4] {
        [
            Self {
                name: "sphere",
                workload: Workload { mesh: icosphere(3), azimuths_deg: around(), size: 64 },
                row: Row {
                    loss: 0.170_693_037_583_7,
                    mean_alpha: 0.368_937_623_910_2,
                    gradient_norm: 0.037_860_353_093_6,
                },
            },
            Self {
                name: "fox",
                workload: Workload { mesh: fox(), azimuths_deg: vec![35.0], size: 256 },
                row: Row {
                    loss: 0.102_502_692_280_6,
                    mean_alpha: 0.148_872_073_516_0,
                    gradient_norm: 0.057_854_773_226_0,
                },
            },
            Self {
                name: "airplane",
                workload: Workload { mesh: airplane(), azimuths_deg: vec![140.0, 260.0], size: 96 },
                row: Row {
                    loss: 0.177_819_545_637_9,
                    mean_alpha: 0.017_931_654_396_5,
                    gradient_norm: 0.012_366_505_107_2,
                },
            },
            Self {
                name: "chair",
                workload: Workload { mesh: chair(), azimuths_deg: vec![215.0], size: 128 },
                row: Row {
                    loss: 0.144_411_877_600_1,
                    mean_alpha: 0.050_386_617_358_0,
                    gradient_norm: 0.037_877_068_108_6,
                },
            },
        ]
    }

    /// W1: the paper's sphere of 1280 faces in 24 views, 64 × 64.
    ///
    /// It differs from the [`icosphere`] of as many faces: every face of its icosahedron is split into 64 at once, not into 4 three times,
    /// which changes the gradient by 2.6 %.
    ///
    /// # Panics
    ///
    /// If the mesh is missing, see [`paper_mesh`].
    pub fn w1() -> Self {
        let mesh = paper_mesh("sphere_642.obj");
        Self {
            name: "w1",
            workload: Workload { mesh, azimuths_deg: around(), size: 64 },
            row: Row { loss: 0.170_335_7, mean_alpha: 0.368_661_6, gradient_norm: 0.035_785_6 },
        }
    }

    /// W2: the cow spot of 5856 faces from its front, 256 × 256.
    ///
    /// # Panics
    ///
    /// If the mesh is missing, see [`paper_mesh`].
    pub fn w2() -> Self {
        let mesh = paper_mesh("spot.obj");
        Self {
            name: "w2",
            workload: Workload { mesh, azimuths_deg: vec![180.0], size: 256 },
            row: Row { loss: 0.110_763_3, mean_alpha: 0.153_004_8, gradient_norm: 0.056_845_9 },
        }
    }
}

/// Azimuths of 24 cameras all around, in degrees.
fn around() -> Vec<f64> {
    (0..24).map(|view| 15.0 * f64::from(view)).collect()
}
