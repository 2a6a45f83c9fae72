//! W1 and W2, the workloads whose exact results are known; skipped where their meshes are missing.

#[allow(dead_code, unreachable_pub, reason = "a library elsewhere, with a reference for the CPU")]
#[path = "../../../../tests/src/workload.rs"]
mod workload;

use burn::{backend::NdArray, tensor::DType};
use softrast_raster::{Rasterizer, Wgpu};
use softrast_softness::{EdgeSoftness, Family};
use workload::{Row, Workload, w1, w2};

use crate::{
    adapter,
    products::{Path, Products},
    seen,
};

#[test]
fn the_workloads_have_their_exact_rows() {
    if !adapter() {
        return;
    }
    for (workload, exact) in [(w1(), Row::W1), (w2(), Row::W2)] {
        if let Some(workload) = workload {
            workload.by_fused_op::<Wgpu>(Rasterizer::TOLERANCE).assert_agrees(&exact);
        }
    }
}

#[test]
fn the_workloads_agree_with_the_kernel_in_f64_to_second_order() {
    if !adapter() {
        return;
    }
    for (name, workload) in [("W1", w1()), ("W2", w2())] {
        let Some(Workload { mesh, azimuths_deg, size }) = workload else { continue };
        let softness = EdgeSoftness { family: Family::Logistic, squared: true };
        let scene = seen(&mesh, (0.0, &azimuths_deg), size, softness, 1e-4);
        let expected = Products::new::<NdArray<f64>>(&scene, DType::F64, Path::Table);
        let found = Products::new::<Wgpu>(&scene, DType::F32, Path::Table);
        found.assert_close(&expected, name);
    }
}
