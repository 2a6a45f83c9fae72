//! Pinhole cameras: values computed by hand, round trips of conventions, derivatives compared with differences.

use proptest::prelude::*;
use softrast_raster::{
    Orbit, Pinhole, PinholeError, Pinholes, PyTorch3dCamera, project, rotate_by_tangent,
    vertex_tensor,
};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::numbers;

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

/// Quarter turns and a wide image, so that every number can be computed by hand.
fn worked() -> Pinhole {
    Pinhole {
        rotation: [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]],
        translation: [0.5, -0.25, 4.0],
        focal: [220.0, 210.0],
        centre: [104.5, 71.75],
        size: [150, 200].into(),
    }
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs();
        assert!(off <= tolerance * (1.0 + expected.abs()), "{found}, not {expected}");
    }
}

fn flat(camera: &Pinhole) -> Vec<f64> {
    let Pinhole { rotation, translation, focal, centre, .. } = camera;
    [&rotation.concat()[..], translation, focal, centre].concat()
}

#[test]
fn a_point_is_in_the_pixel_that_was_worked_out_by_hand() {
    // c = (3 + 0.5, -2 - 0.25, 1 + 4) = (3.5, -2.25, 5).
    let (camera, point) = (worked(), [1.0, 2.0, 3.0]);
    assert_close(&camera.pixel(point), &[258.5, -22.75, 5.0], 1e-12);
    let device = Default::default();
    let seen = project(vertex_tensor::<B>(&[point], &device), Pinholes::new(&[camera], &device));
    // A pixel is 2 / 150 wide; the middle of the image is at (100, 75).
    let expected = [(258.5 - 100.0) / 75.0, (75.0 + 22.75) / 75.0, 5.0];
    assert_close(&numbers(seen.tensor()), &expected, 1e-12);
}

#[test]
fn conventions_of_others_are_the_matrices_that_were_worked_out_by_hand() {
    let camera = worked();
    camera.check().unwrap();
    // The eye is -Rᵀ t; columns are right, up and behind.
    let matrix = [
        [0.0, 0.0, -1.0, -4.0],
        [0.0, 1.0, 0.0, -0.25],
        [1.0, 0.0, 0.0, -0.5],
        [0.0, 0.0, 0.0, 1.0],
    ];
    assert_close(&camera.to_opengl().concat(), &matrix.concat(), 1e-12);
    // Columns are left, up and ahead; NDC of 150 pixels.
    let PyTorch3dCamera { r, t, focal_length, principal_point } = camera.to_pytorch3d();
    let expected = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    assert_close(&r.concat(), &expected.concat(), 1e-12);
    assert_close(&t, &[-0.5, 0.25, 4.0], 1e-12);
    assert_close(&focal_length, &[220.0 / 75.0, 2.8], 1e-12);
    assert_close(&principal_point, &[-0.06, 3.25 / 75.0], 1e-12);
    assert_eq!(camera.orbit(), None);

    // At azimuth 90 and elevation 0 an orbit is at +x and looks along -x: right is -z there.
    let orbit = Orbit { distance: 3.0, elevation_deg: 0.0, azimuth_deg: 90.0, fov_deg: 90.0 };
    let side = Pinhole::from_orbit(&orbit, 64);
    let expected = [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]];
    assert_close(&side.rotation.concat(), &expected.concat(), 1e-12);
    assert_close(&side.translation, &[0.0, 0.0, 3.0], 1e-12);
    assert_close(&[side.focal, side.centre].concat(), &[32.0; 4], 1e-12);
}

#[test]
fn what_is_no_camera_says_what_is_wrong() {
    let camera = worked();
    let error = |camera: Pinhole| camera.check().unwrap_err();
    let mut stretched = camera;
    stretched.rotation[0][2] = 1.01;
    assert!(
        matches!(error(stretched), PinholeError::NoRotation(off) if (off - 0.0201).abs() < 1e-9)
    );
    let mirrored = Pinhole { rotation: camera.rotation.map(|row| row.map(|x| -x)), ..camera };
    assert_eq!(error(mirrored), PinholeError::Mirrors);
    let nowhere = Pinhole { translation: [f64::NAN, 0.0, 1.0], ..camera };
    assert_eq!(error(nowhere), PinholeError::NotFinite);
    assert_eq!(
        error(Pinhole { focal: [0.0, 1.0], ..camera }),
        PinholeError::NoFocalLength(0.0, 1.0)
    );
    assert_eq!(error(Pinhole { size: [0, 5].into(), ..camera }), PinholeError::NoPixels);
}

/// Two views with separate poses and shared intrinsics, projected from a vector of 3 vertices, 2 tangents, 2 translations and intrinsics.
fn seen(x: Tensor<AA, 1>) -> Tensor<AA, 1> {
    let part = |from: usize, count: usize| x.clone().narrow(0, from, count);
    let start = [worked(), Pinhole { translation: [0.1, 0.3, 3.0], ..worked() }];
    let start = Pinholes::<AA>::new(&start, &Default::default());
    let cameras = Pinholes {
        rotation: rotate_by_tangent(part(9, 6).reshape([2, 3]), start.rotation),
        translation: part(15, 6).reshape([2, 3]),
        intrinsics: part(21, 4).reshape([1, 4]),
        size: start.size,
    };
    project(part(0, 9).reshape([1, 3, 3]), &cameras).tensor().flatten(0, 2)
}

fn point(tangent: f64) -> Vec<f64> {
    let mut x: Vec<f64> = (0..9).map(|k| (1.7 * k as f64).sin()).collect();
    x.extend([1.0, -0.5, 0.25, 0.3, 0.8, -1.2].map(|w: f64| tangent * w));
    x.extend([0.5, -0.25, 4.0, 0.1, 0.3, 3.0, 220.0, 210.0, 104.5, 71.75]);
    x
}

/// Gradient of a weighted sum of squares of the projection, and gradient of a weighted sum of that.
fn orders(x: &[f64]) -> [Vec<f64>; 2] {
    let vector = |values: Vec<f64>| Tensor::<A, 1>::from_data(&values[..], &Default::default());
    let wave = |count: usize, step: f64| (0..count).map(|k| (step * k as f64).cos()).collect();
    let inner = vector(x.to_vec()).require_grad();
    let outer = Tensor::<AA, 1>::from_inner(inner.clone()).require_grad();
    let found = seen(outer.clone());
    let weights = Tensor::from_inner(vector(wave(18, 0.7)));
    let gradient = outer.grad(&(found.clone() * found * weights).sum().backward()).unwrap();
    let again = (gradient.clone() * vector(wave(x.len(), 1.3))).sum().backward();
    [numbers(gradient.inner()), numbers(inner.grad(&again).unwrap())]
}

/// With tangents of length 0, where the series are used, at their limit, and well beyond.
#[test]
fn gradients_to_pose_intrinsics_and_vertices_are_differences_to_second_order() {
    let value = |x: &[f64]| {
        let found = numbers(seen(Tensor::from_data(x, &Default::default())).inner().inner());
        let weighted = found.iter().enumerate().map(|(k, x)| x * x * (0.7 * k as f64).cos());
        weighted.sum::<f64>()
    };
    for tangent in [0.0, 1e-5, 0.0275, 0.8] {
        let x = point(tangent);
        let [gradient, second] = orders(&x);
        for k in 0..x.len() {
            let h = 1e-5 * x[k].abs().max(1.0);
            let at = |by: f64| {
                let mut x = x.clone();
                x[k] += by;
                x
            };
            let expected = (value(&at(h)) - value(&at(-h))) / (2.0 * h);
            assert_close(&[gradient[k]], &[expected], 1e-5);
            // The second order is symmetric: differences of the weighted gradient along each axis.
            let weighted = |x: Vec<f64>| {
                let gradient = orders(&x)[0].clone();
                gradient.iter().enumerate().map(|(k, x)| x * (1.3 * k as f64).cos()).sum::<f64>()
            };
            let expected = (weighted(at(h)) - weighted(at(-h))) / (2.0 * h);
            assert_close(&[second[k]], &[expected], 1e-5);
        }
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(256))]

    #[test]
    fn conventions_lead_there_and_back(
        tangent in [-3.0..3.0, -3.0..3.0, -3.0..3.0f64],
        translation in [-5.0..5.0, -5.0..5.0, 0.1..5.0f64],
        focal in [1.0..2000.0, 1.0..2000.0f64],
        centre in [-100.0..900.0, -100.0..900.0f64],
        size in [1..2000usize, 1..2000usize],
    ) {
        let device = Default::default();
        let identity = Tensor::<B, 2>::eye(3, &device).reshape([1, 3, 3]);
        let tangent = Tensor::<B, 1>::from_data(tangent, &device).reshape([1, 3]);
        let r = numbers(rotate_by_tangent(tangent, identity));
        let rotation = [0, 1, 2].map(|k| [r[3 * k], r[3 * k + 1], r[3 * k + 2]]);
        let camera = Pinhole { rotation, translation, focal, centre, size: size.into() };
        prop_assert_eq!(camera.check(), Ok(()));
        let off = rotation[0].iter().map(|x| x * x).sum::<f64>() - 1.0;
        prop_assert!(off.abs() < 1e-12, "{off}");

        let opengl = Pinhole::from_opengl(&camera.to_opengl(), focal, centre, size);
        assert_close(&flat(&opengl), &flat(&camera), 1e-12);
        let pytorch3d = Pinhole::from_pytorch3d(&camera.to_pytorch3d(), size);
        assert_close(&flat(&pytorch3d), &flat(&camera), 1e-12);

        // A part of the image, enlarged: the same point at its position there.
        let crop = camera.cropped([10.0, -20.0], [40.0, 80.0], [160, 80]);
        let point = [0, 1, 2].map(|k| camera.eye()[k] + 2.0 * rotation[2][k] + 0.1 * rotation[0][k]);
        let ([u, v, _], [x, y, _]) = (camera.pixel(point), crop.pixel(point));
        assert_close(&[x, y], &[2.0 * (u - 10.0), 2.0 * (v + 20.0)], 1e-9);
    }

    #[test]
    fn an_orbit_is_a_pinhole_that_sees_the_same(
        distance in 0.1..10.0,
        elevation_deg in -89.0..89.0,
        azimuth_deg in -179.0..179.0,
        fov_deg in 2.0..160.0,
        size in [1..300usize, 1..300usize],
        vertex in [-2.0..2.0, -2.0..2.0, -2.0..2.0],
    ) {
        let orbit = Orbit { distance, elevation_deg, azimuth_deg, fov_deg };
        let camera = Pinhole::from_orbit(&orbit, size);
        prop_assert_eq!(camera.check(), Ok(()));
        let device = Default::default();
        let vertices = vertex_tensor::<B>(&[vertex], &device);
        let expected = numbers(project(vertices.clone(), orbit.tensor(&device)).tensor());
        let cameras = Pinholes::new(&[camera], &device);
        assert_close(&numbers(project(vertices.clone(), &cameras).tensor()), &expected, 1e-9);
        let Orbit { distance: d, elevation_deg: e, azimuth_deg: a, fov_deg: f } = camera.orbit().unwrap();
        assert_close(&[d, e, a, f], &[distance, elevation_deg, azimuth_deg, fov_deg], 1e-9);

        let up = [0.0, 1.0, 0.0];
        let looking = Pinhole::look_at(camera.eye(), [0.0; 3], up, fov_deg, size);
        assert_close(&flat(&looking), &flat(&camera), 1e-9);
    }
}
