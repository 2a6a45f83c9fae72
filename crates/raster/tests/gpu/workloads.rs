//! Workloads whose exact results are known.

#[allow(dead_code, unreachable_pub, reason = "libraries elsewhere, with a reference for the CPU")]
#[path = "../../../../tests/support/known_row.rs"]
mod known_row;
#[allow(unreachable_pub, reason = "a library elsewhere")]
#[path = "../../../../tests/support/paper_mesh.rs"]
mod paper_mesh;
#[allow(dead_code, unreachable_pub, reason = "a library elsewhere, with a reference for the CPU")]
#[path = "../../../../tests/support/workload.rs"]
mod workload;

use known_row::KnownRow;
use softrast_raster::low_level::Rasterizer;
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{DType, NdArray};
use workload::Workload;

use super::{
    adapter,
    products::{Path, Products},
    seen,
};
use crate::Gpu;

/// Bounds for loss, mean coverage and gradient norm.
const BOUNDS: [f64; 3] = [1e-5, 1e-5, 1e-4];

fn assert_exact(KnownRow { name, workload, row }: &KnownRow) {
    workload.by_fused_op::<Gpu>(Rasterizer::TOLERANCE).assert_agrees(name, row, BOUNDS);
}

fn assert_agrees_with_the_kernel(KnownRow { name, workload, .. }: KnownRow) {
    let Workload { mesh, azimuths_deg, size } = workload;
    let softness = EdgeSoftness::squared(Family::Logistic);
    let scene = seen(&mesh, (0.0, &azimuths_deg), size, softness, 1e-4);
    let expected = Products::new::<NdArray<f64>>(&scene, DType::F64, Path::Table);
    let found = Products::new::<Gpu>(&scene, DType::F32, Path::Table);
    found.assert_close(&expected, name);
}

#[test]
fn workloads_have_their_exact_rows() {
    if adapter() {
        KnownRow::ours().iter().for_each(assert_exact);
    }
}

#[test]
fn workloads_agree_with_the_kernel_in_f64_to_second_order() {
    if adapter() {
        KnownRow::ours().into_iter().for_each(assert_agrees_with_the_kernel);
    }
}

#[test]
#[ignore = "needs the paper's meshes"]
fn workloads_of_the_paper_have_their_exact_rows_and_agree_with_the_kernel() {
    if adapter() {
        for known in [KnownRow::w1(), KnownRow::w2()] {
            assert_exact(&known);
            assert_agrees_with_the_kernel(known);
        }
    }
}
