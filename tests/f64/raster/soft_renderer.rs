//! Support and knots adapt to the parameters: the stated error bound holds after any change.

use softrast_raster::{
    Projected, SoftRenderer, TConorm, hard_coverage, low_level::Rasterizer, reference,
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, vector};

use super::triangles::triangles;

type B = NdArray<f64>;

const SIZE: usize = 16;
const TOLERANCE: f64 = 1e-4;

fn shaped(vertices: &[f64]) -> Tensor<B, 3> {
    vector::<B>(vertices).reshape([1, vertices.len() as i64 / 3, 3])
}

/// The largest difference of the renderer's image to that of every pixel-face pair, and the stated error.
fn off(
    renderer: &SoftRenderer<EdgeSoftness>,
    (vertices, faces): (&[f64], &[[u32; 3]]),
    softness: EdgeSoftness,
    phi: &[f64],
) -> [f64; 2] {
    let drawn = numbers(renderer.silhouette_with(Projected::new(shaped(vertices)), &vector(phi)));
    let scene = reference::Scene { faces, size: SIZE.into() };
    let t_conorm = TConorm::Probabilistic;
    let sums = reference::sums(scene, shaped(vertices), &softness, t_conorm, vector(phi));
    let exact = numbers(t_conorm.coverage(sums));
    let largest = drawn.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let error = renderer.prepared::<B>(phi).profile().error();
    [largest, error]
}

fn renderer(softness: EdgeSoftness, faces: &[[u32; 3]], scale: f64) -> SoftRenderer<EdgeSoftness> {
    SoftRenderer::new(faces, SIZE, softness, scale).with_tolerance(TOLERANCE)
}

#[test]
fn no_pixel_is_off_by_more_than_the_tolerance_where_a_face_covers_before_its_edge() {
    // The law starts outside, so the optical depth has a pole there, away from the edge and from the end of the support.
    let softness = EdgeSoftness::squared(Family::Exp);
    let (vertices, faces) = triangles(553, 20);
    let scale = |width: f64| 10f64.powf(2.0 * width);
    let width = -2.128_356_450_252_82;
    let renderer = renderer(softness, &faces, scale(width));
    let mut phi = renderer.phi().to_vec();
    for (wider, shift) in
        [(-0.768_596_027_845_630_1, 0.0), (2.127_549_584_422_48, -0.209_657_546_645_118_85)]
    {
        phi = softness.with_scale_values(&phi, scale(wider));
        phi[1] += shift;
        let [largest, stated] = off(&renderer, (&vertices, &faces), softness, &phi);
        assert_eq!(stated, TOLERANCE);
        assert!(largest <= TOLERANCE, "{phi:?}: off by {largest:e}");
    }
}

#[test]
fn a_softness_that_is_only_stretched_keeps_its_knots() {
    let (_, faces) = triangles(1, 20);
    for family in [Family::Logistic, Family::Exp, Family::Gamma, Family::Mlp] {
        for squared in [false, true] {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            let renderer = renderer(softness, &faces, 0.01);
            let [outer, inner] = renderer.prepared::<B>(renderer.phi()).profile().support();
            let wider = softness.with_scale_values(renderer.phi(), 4.0);
            let factor = if squared { 2.0 } else { 4.0 };
            for (found, before) in
                renderer.prepared::<B>(&wider).profile().support().into_iter().zip([outer, inner])
            {
                assert!((found / before / factor - 1.0).abs() < 1e-12, "{family} {found} {before}");
            }
            let other = SoftRenderer::with_rasterizer(
                Rasterizer { tolerance: TOLERANCE, ..Rasterizer::new(SIZE) },
                faces.clone(),
                softness,
                wider.clone(),
            );
            let anew = *other.prepared::<B>(&wider).profile();
            assert_eq!(renderer.prepared::<B>(&wider).profile().knots(), anew.knots(), "{family}");
        }
    }
}

#[test]
fn a_support_that_does_not_end_is_chosen_anew_before_faces_could_leave_it() {
    let (_, faces) = triangles(1, 3);
    let softness = EdgeSoftness::new(Family::Reciprocal);
    let used = renderer(softness, &faces, 0.1).with_tolerance(1e-9);
    let is_endless = |renderer: &SoftRenderer<EdgeSoftness>, scale: f64| {
        let silhouette = renderer.prepared::<B>(&softness.default_phi(scale));
        silhouette.profile().support().map(|radius| radius > 1.5e6)
    };
    assert_eq!(is_endless(&used, 0.1), [true; 2]);
    for scale in [0.05, 0.01, 1e-3, 1e-4, 0.1, 1.0] {
        let fresh = renderer(softness, &faces, scale).with_tolerance(1e-9);
        assert_eq!(is_endless(&used, scale), is_endless(&fresh, scale), "{scale}");
    }
}

#[test]
fn gradients_to_vertices_and_parameters_are_those_of_the_image() {
    type A = Autodiff<B>;
    let (vertices, faces) = triangles(2, 6);
    let softness = EdgeSoftness::new(Family::Gamma);
    let renderer = renderer(softness, &faces, 0.05).with_tolerance(1e-9);
    let loss = |vertices: Tensor<A, 1>, phi: Tensor<A, 1>| {
        let vertices = vertices.clone().reshape([1, vertices.dims()[0] as i64 / 3, 3]);
        renderer.silhouette_with(Projected::new(vertices), &phi).powi_scalar(2).sum()
    };
    let both = [vertices, renderer.phi().to_vec()];
    let [at, phi] = [0, 1].map(|k| vector::<A>(&both[k]).require_grad());
    let grads = loss(at.clone(), phi.clone()).backward();
    let found = [at, phi].map(|x| numbers(x.grad(&grads).unwrap()));
    const H: f64 = 1e-5;
    for (which, entries) in [(0, vec![0, 4, 6, 10, 13]), (1, vec![0, 1])] {
        for k in entries {
            let value = |h: f64| {
                let mut moved = both.clone();
                moved[which][k] += h;
                numbers(loss(vector(&moved[0]), vector(&moved[1])))[0]
            };
            let (slope, found) = ((value(H) - value(-H)) / (2.0 * H), found[which][k]);
            let close = (slope - found).abs() < 1e-4 * (1.0 + slope.abs());
            assert!(close, "{which} {k}: {found}, not {slope}");
        }
    }
}

#[test]
fn parameters_that_are_set_draw_as_in_a_renderer_made_with_them_and_the_surrogate_stays() {
    type A = Autodiff<B>;
    let (vertices, faces) = triangles(4, 12);
    let softness = EdgeSoftness::new(Family::Gauss);
    let of = |scale| SoftRenderer::new(&faces, SIZE, softness, scale).with_surrogate(softness, 0.3);
    let image = |renderer: &SoftRenderer<EdgeSoftness>| {
        let leaf = Tensor::<A, 3>::from_inner(shaped(&vertices)).require_grad();
        let image = renderer.silhouette(Projected::new(leaf.clone()));
        let grads = image.clone().powi_scalar(2).sum().backward();
        [numbers(image), numbers(leaf.grad(&grads).unwrap())].concat()
    };
    let mut moved = of(0.2);
    for scale in [0.1, 0.06, 0.04, 0.06] {
        moved.set_phi(softness.default_phi(scale));
        for (found, expected) in image(&moved).into_iter().zip(image(&of(scale))) {
            let close = (found - expected).abs() < 1e-4 * (1.0 + expected.abs());
            assert!(close, "{scale}: {found}, not {expected}");
        }
    }
}

#[test]
#[should_panic(expected = "has 1 parameters, found 2")]
fn parameters_of_another_length_are_refused() {
    let softness = EdgeSoftness::new(Family::Logistic);
    renderer(softness, &[[0, 1, 2]], 0.1).set_phi(vec![0.0, 0.0]);
}

#[test]
fn without_back_faces_there_are_only_front_faces() {
    let (vertices, faces) = triangles(5, 40);
    let softness = EdgeSoftness::new(Family::Logistic);
    let corner = |v: u32| [vertices[3 * v as usize], vertices[3 * v as usize + 1]];
    let is_front = |face: &&[u32; 3]| {
        let [[ax, ay], [bx, by], [cx, cy]] = face.map(corner);
        (bx - ax) * (cy - ay) >= (by - ay) * (cx - ax)
    };
    let front: Vec<[u32; 3]> = faces.iter().filter(is_front).copied().collect();
    assert!(front.len() > 5 && front.len() < faces.len() - 5);
    let drawn = |renderer: SoftRenderer<EdgeSoftness>| {
        let renderer = renderer.with_tolerance(1e-9);
        numbers(renderer.silhouette(Projected::new(shaped(&vertices))))
    };
    let found = drawn(renderer(softness, &faces, 0.02).without_back_faces());
    let expected = drawn(renderer(softness, &front, 0.02));
    assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9));
    assert_ne!(drawn(renderer(softness, &faces, 0.02)), found);
}

#[test]
fn other_faces_are_drawn_as_a_renderer_of_their_own_does_and_keep_the_knots() {
    let (vertices, faces) = triangles(6, 40);
    let softness = EdgeSoftness::new(Family::Gamma);
    let all = renderer(softness, &faces, 0.02);
    all.silhouette(Projected::new(shaped(&vertices)));
    let drawn = |renderer: &SoftRenderer<EdgeSoftness>| {
        numbers(renderer.silhouette(Projected::new(shaped(&vertices))))
    };
    let few = all.with_faces(&faces[..13]);
    let known = drawn(&renderer(softness, &faces[..13], 0.02));
    assert!(drawn(&few).iter().zip(&known).all(|(a, b)| (a - b).abs() <= 2.0 * TOLERANCE));
    let support = |renderer: &SoftRenderer<EdgeSoftness>| {
        renderer.prepared::<B>(renderer.phi()).profile().support()
    };
    assert_eq!(support(&few), support(&all), "knots for forty faces serve thirteen");
    // Twenty times as many faces need a wider support, and the tolerance holds.
    let many: Vec<[u32; 3]> = faces.iter().cycle().take(20 * faces.len()).copied().collect();
    let more = all.with_faces(many.clone());
    let known = drawn(&renderer(softness, &many, 0.02));
    assert!(support(&more) >= support(&renderer(softness, &many, 0.02)));
    assert!(drawn(&more).iter().zip(&known).all(|(a, b)| (a - b).abs() <= 2.0 * TOLERANCE));
    assert_eq!(drawn(&more.with_faces(faces.clone())).len(), SIZE * SIZE);
}

#[test]
fn a_hard_image_has_the_gradient_of_the_soft_one() {
    type A = Autodiff<B>;
    let (vertices, faces) = triangles(7, 12);
    let softness = EdgeSoftness::new(Family::Logistic);
    let soft = renderer(softness, &faces, 0.05);
    let hard = soft.clone().with_hard_image(3);
    let pass = |renderer: &SoftRenderer<EdgeSoftness>| {
        let leaf = vector::<A>(&vertices).require_grad();
        let count = vertices.len() as i64 / 3;
        let image = renderer.silhouette(Projected::new(leaf.clone().reshape([1, count, 3])));
        let gradient = leaf.grad(&(image.clone() * 2.0).sum().backward()).unwrap();
        (numbers(image.inner()), numbers(gradient))
    };
    let ((soft_image, soft_gradient), (image, gradient)) = (pass(&soft), pass(&hard));
    assert_eq!(gradient, soft_gradient);
    assert_ne!(image, soft_image);
    let known = hard_coverage(Projected::new(shaped(&vertices)), &faces, SIZE, 3);
    assert!(image.iter().zip(numbers(known)).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn gradients_of_few_pixels_and_of_the_others_add_up_to_those_of_all() {
    let (vertices, faces) = triangles(7, 60);
    let renderer = renderer(EdgeSoftness::new(Family::Gauss), &faces, 0.01);
    let gradient = |upstream: &dyn Fn(usize) -> f64| {
        let vertices = Tensor::<Autodiff<B>, 3>::from_inner(shaped(&vertices)).require_grad();
        let image = renderer.silhouette(Projected::new(vertices.clone()));
        let upstream: Vec<f64> = (0..SIZE * SIZE).map(upstream).collect();
        let upstream = vector::<B>(&upstream).reshape([1, SIZE as i64, SIZE as i64]);
        let loss = (image * Tensor::from_inner(upstream)).sum();
        numbers(vertices.grad(&loss.backward()).expect("the image depends on them"))
    };
    let is_one_of_few = |pixel: usize| pixel % 37 == 5;
    let few = gradient(&|pixel| f64::from(u8::from(is_one_of_few(pixel))));
    let others = gradient(&|pixel| f64::from(u8::from(!is_one_of_few(pixel))));
    let all = gradient(&|_| 1.0);
    assert!(few.iter().any(|g| g.abs() > 1e-3) && few.contains(&0.0));
    for ((few, others), all) in few.iter().zip(&others).zip(&all) {
        assert!((few + others - all).abs() < 1e-12 * (1.0 + all.abs()), "{few} {others} {all}");
    }
    assert!(gradient(&|_| 0.0).iter().all(|&g| g == 0.0));
}
