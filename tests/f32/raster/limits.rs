//! The fused op in f32: close to f64, and finite at the limits of f32.

use std::sync::Arc;

use softrast_mesh::{Mesh, fox};
use softrast_raster::{RasterBackend, low_level::Rasterizer, project};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, DType, NdArray, Tensor, TensorData};

const SIZE: usize = 16;

fn tensor<T: Backend>(values: &[f64], dtype: DType) -> Tensor<T, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    Tensor::from_data(data, (&Default::default(), dtype))
}

/// Coverage and the gradient of `Σ coverage²` with respect to the vertices and to phi.
fn render<T: RasterBackend>(
    corners: &[[f64; 3]],
    softness: EdgeSoftness,
    scale: f64,
    dtype: DType,
) -> [Vec<f64>; 3]
where
    Autodiff<T>: RasterBackend,
{
    let faces: Arc<[[u32; 3]]> =
        (0..corners.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let vertices = tensor::<Autodiff<T>>(&corners.concat(), dtype).require_grad();
    let phi = tensor::<Autodiff<T>>(&softness.default_phi(scale), dtype).require_grad();
    let silhouette = Rasterizer::new(SIZE).prepare(&faces, softness, &phi);
    let shaped = vertices.clone().reshape([1, corners.len() as i64, 3]);
    let image = silhouette.coverage(shaped, phi.clone());
    let grads = (image.clone() * image.clone()).sum().backward();
    let numbers = |t: Tensor<T, 1>| t.into_data().iter::<f64>().collect::<Vec<_>>();
    [
        numbers(image.inner().reshape([SIZE * SIZE])),
        numbers(vertices.grad(&grads).expect("vertices are tracked")),
        numbers(phi.grad(&grads).expect("phi is tracked")),
    ]
}

/// A triangle, one behind it, one off screen, and one on pixel centres.
fn scene() -> Vec<[f64; 3]> {
    vec![
        [-0.7, -0.6, 2.0],
        [0.6, -0.5, 2.0],
        [0.1, 0.8, 2.0],
        [-0.3, -0.9, 3.0],
        [0.9, 0.1, 3.0],
        [-0.2, 0.7, 3.0],
        [40.0, 40.0, 2.0],
        [41.0, 40.0, 2.0],
        [40.0, 41.0, 2.0],
        [-7.0 / 16.0, -7.0 / 16.0, 2.0],
        [5.0 / 16.0, -7.0 / 16.0, 2.0],
        [-7.0 / 16.0, 5.0 / 16.0, 2.0],
    ]
}

#[test]
fn no_scale_is_too_narrow_or_too_wide_for_finite_numbers() {
    for family in Family::ALL {
        for squared in [false, true] {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            for scale in [1e-14, 1e-9, 1e-7, 1e-5, 1e-2, 1.0, 1e3] {
                let [image, vertices, phi] =
                    render::<NdArray<f32>>(&scene(), softness, scale, DType::F32);
                let name = format!("{family}, squared {squared}, scale {scale}");
                assert!(image.iter().all(|a| (0.0..=1.0).contains(a)), "{name}: {image:?}");
                assert!(vertices.iter().all(|g| g.is_finite()), "{name}: {vertices:?}");
                assert!(phi.iter().all(|g| g.is_finite()), "{name}: {phi:?}");
            }
        }
    }
}

#[test]
fn f32_agrees_with_f64() {
    let difference = |a: &[f64], b: &[f64]| {
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
        norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
    };
    for family in [Family::Logistic, Family::Gauss, Family::Exp, Family::Gamma, Family::Mlp] {
        let softness = EdgeSoftness::new(family);
        let single = render::<NdArray<f32>>(&scene(), softness, 0.05, DType::F32);
        let double = render::<NdArray<f32>>(&scene(), softness, 0.05, DType::F64);
        for (k, (single, double)) in single.iter().zip(&double).enumerate() {
            let error = difference(single, double);
            assert!(error < 1e-4, "{family}, quantity {k}: relative difference {error:e}");
        }
    }
}

#[test]
fn gradients_are_finite_on_every_broken_mesh_that_loads() {
    type A = Autodiff<NdArray<f32>>;
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/mesh/tests/nasty");
    let mut loaded = 0;
    for entry in std::fs::read_dir(folder).expect("the nasty files are part of the repository") {
        let path = entry.expect("the folder can be read").path();
        if path.extension().is_none_or(|extension| extension != "obj") {
            continue;
        }
        let Ok(mesh) = Mesh::load(&path) else { continue };
        loaded += 1;
        let positions = mesh.positions().as_flattened();
        let vertices = tensor::<A>(positions, DType::F32).require_grad();
        let orbit = tensor::<A>(&[2.732, 10.0, 30.0, 60.0], DType::F32).reshape([1, 4]);
        let shaped = vertices.clone().reshape([1, mesh.positions().len() as i64, 3]);
        let softness = EdgeSoftness::new(Family::Logistic);
        let phi = tensor::<A>(&softness.default_phi(0.02), DType::F32).require_grad();
        let silhouette = Rasterizer::new(SIZE).prepare(&mesh.faces().into(), softness, &phi);
        let image = silhouette.coverage(project(shaped, orbit).tensor(), phi.clone());
        assert!(image.to_data().iter::<f64>().all(|a| (0.0..=1.0).contains(&a)), "{path:?}");
        let grads = (image.clone() * image).sum().backward();
        let grad = vertices.grad(&grads).expect("vertices are tracked");
        assert!(grad.into_data().iter::<f64>().all(f64::is_finite), "{path:?}");
        let grad = phi.grad(&grads).expect("phi is tracked");
        assert!(grad.into_data().iter::<f64>().all(f64::is_finite), "{path:?}");
    }
    assert!(loaded > 20, "only {loaded} files loaded");
}

/// Coverage in tenths, `.` for none and `#` for all.
fn drawn(softness: EdgeSoftness, scale: f64) -> String {
    type N = NdArray<f32>;
    const WIDE: usize = 24;
    let fox = fox();
    let positions = fox.positions().as_flattened();
    let vertices = tensor::<N>(positions, DType::F32).reshape([1, fox.positions().len() as i64, 3]);
    let orbit = tensor::<N>(&[3.0, 10.0, 90.0, 40.0], DType::F32).reshape([1, 4]);
    let phi = tensor::<N>(&softness.default_phi(scale), DType::F32);
    let silhouette = Rasterizer::new(WIDE).prepare(&fox.faces().into(), softness, &phi);
    let image = silhouette.coverage(project(vertices, orbit).tensor(), phi);
    let character = |a: f64| match (10.0 * a).round() as u32 {
        0 => '.',
        10.. => '#',
        tenth => char::from_digit(tenth, 10).expect("one digit"),
    };
    let image: String = image.into_data().iter::<f64>().map(character).collect();
    (0..WIDE).map(|row| format!("{}\n", &image[row * WIDE..(row + 1) * WIDE])).collect()
}

#[test]
fn a_fox_looks_like_one() {
    let sharp = EdgeSoftness::new(Family::Logistic);
    assert_eq!(drawn(sharp, 0.002), SHARP);
    assert_eq!(drawn(EdgeSoftness::squared(sharp.family), 0.01), SOFT);
}

const SHARP: &str = concat!(
    "........................\n",
    "........................\n",
    "#................##.....\n",
    "#7...............##.....\n",
    "##..............####1...\n",
    "##6.............#####...\n",
    "###............9#######.\n",
    "####...........########1\n",
    "######9############3....\n",
    ".9#9###############.....\n",
    "..################......\n",
    ".....#############......\n",
    "......############......\n",
    "......9###.16####.......\n",
    ".......###....###.......\n",
    ".......##3....###.......\n",
    ".......##.....###.......\n",
    ".......##.....##9.......\n",
    "......###.....1##.......\n",
    "......###......##.......\n",
    "........................\n",
    "........................\n",
    "........................\n",
    "........................\n",
);
const SOFT: &str = concat!(
    "862............4###81...\n",
    "##81..........19####71..\n",
    "###4..........4######61.\n",
    "###91........19#######61\n",
    "####6........4#########7\n",
    "#####423322228##########\n",
    "########################\n",
    "########################\n",
    "########################\n",
    "#######################9\n",
    "####################9431\n",
    "9###################5...\n",
    "27##################3...\n",
    ".125###############81...\n",
    "...18##############3....\n",
    "....5##############2....\n",
    "....6######8#######1....\n",
    "....8######6#######2....\n",
    "...19######5#######3....\n",
    "...18######27######4....\n",
    "....6#####712######2....\n",
    "....18###82..49##95.....\n",
    ".....13431....1332......\n",
    "........................\n",
);
