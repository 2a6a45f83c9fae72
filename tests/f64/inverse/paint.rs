use softrast_inverse::{PaintTargets, SolveConfig, paint};
use softrast_mesh::{Mesh, icosphere};
use softrast_meta::Objective;
use softrast_raster::{
    Attributes, ColourRenderer, Orbit, Pinhole, Pinholes, RasterBackend, project, vertex_tensor,
};
use softrast_softness::Family;
use softrast_tensor::Tensor;
use softrast_views::{PaintedView, Picture, View, coloured_pixels};

use crate::differences::check_gradient;

const SIZE: usize = 32;

fn camera(elevation_deg: f64, azimuth_deg: f64) -> Pinhole {
    let orbit = Orbit { distance: 3.0, elevation_deg, azimuth_deg, fov_deg: 50.0 };
    Pinhole::from_orbit(&orbit, 48)
}

/// A ball whose colours depend on position.
fn ball() -> Mesh {
    let ball = icosphere(3);
    let colours = ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.4 * (3.0 * x).sin()));
    let colours = colours.collect();
    ball.with_colours(colours).unwrap()
}

/// Renders a mesh, with transparency or over white.
fn seen(mesh: &Mesh, camera: Pinhole, opaque: bool) -> PaintedView {
    let [red, green, blue, covered] = coloured_pixels(mesh, &camera);
    let width = camera.size.width;
    let picture =
        |levels: Vec<f64>| Picture::new(levels.iter().map(|&x| x as f32).collect(), width);
    let straight = |channel: Vec<f64>| {
        let pairs = channel.iter().zip(&covered);
        picture(pairs.map(|(x, a)| if opaque { x + 1.0 - a } else { x / a.max(1e-9) }).collect())
    };
    let colours = [red, green, blue].map(straight);
    let mask = picture(covered.clone());
    let opacity = if opaque { picture(vec![1.0; covered.len()]) } else { mask.clone() };
    let view = View {
        name: "ball".into(),
        picture: "none".into(),
        mask,
        camera,
        distortion: None,
        off: 0.0,
    };
    PaintedView::new(view, colours, &opacity)
}

fn all_around(opaque: bool) -> Vec<PaintedView> {
    let ball = ball();
    let directions =
        [(0.0, 0.0), (0.0, 90.0), (10.0, 180.0), (0.0, 270.0), (80.0, 0.0), (-80.0, 0.0)];
    directions.map(|(e, a)| seen(&ball, camera(e, a), opaque)).to_vec()
}

#[test]
fn a_ball_gets_its_colours_back_from_pictures_with_and_without_transparency() {
    for opaque in [false, true] {
        let views = all_around(opaque);
        let plain = Mesh::new(ball().positions().to_vec(), ball().faces().to_vec()).unwrap();
        let config = SolveConfig { size: 64, steps: 60, learning_rate: 0.05 };
        let mut losses = Vec::new();
        let found = paint(&plain, &views, &config, |_, loss| {
            losses.push(loss);
            Ok(())
        });
        let found = found.unwrap();
        assert_eq!((losses.len(), found.positions()), (60, plain.positions()));
        assert!(losses[59] < 0.01 * losses[0], "{losses:?}");
        // From a camera that was not used.
        let aside = seen(&ball(), camera(30.0, 45.0), false);
        let psnr = aside.psnr(&found).unwrap();
        assert!(psnr > 28.0, "{psnr} dB, opaque: {opaque}");
    }
}

#[test]
fn what_was_drawn_itself_has_no_error_and_nothing_has_none_to_tell() {
    let view = seen(&ball(), camera(0.0, 0.0), false);
    assert!(view.psnr(&ball()).unwrap() > 90.0);
    let black = ball().with_colours(vec![[0.0; 3]; ball().positions().len()]).unwrap();
    assert!(view.psnr(&black).unwrap() < 10.0);
    let behind = ball().with_positions(vec![[0.0, 0.0, 1e3]; ball().positions().len()]).unwrap();
    let empty = seen(&behind, camera(0.0, 0.0), false);
    assert_eq!(empty.psnr(&behind), None);
}

#[test]
fn views_that_show_nothing_and_meshes_behind_cameras_are_errors() {
    let views = all_around(false);
    let config = SolveConfig { size: 16, steps: 1, learning_rate: 0.05 };
    let message = |mesh: &Mesh, views: &[PaintedView]| {
        paint(mesh, views, &config, |_, _| Ok(())).err().unwrap().to_string()
    };
    assert!(message(&ball(), &[]).contains("need a view"));
    let point = ball().with_positions(vec![[0.0; 3]; ball().positions().len()]).unwrap();
    assert!(message(&point, &views).contains("no extent"));
    let far = ball().positions().iter().map(|p| [p[0], p[1], p[2] - 100.0]).collect();
    let behind = ball().with_positions(far).unwrap();
    assert!(message(&behind, &views[..1]).contains("no camera has the mesh before it"));
}

/// The loss of a coloured ball as a function of its colours, then its vertices; so soft that differences are accurate.
struct Painted {
    views: Vec<PaintedView>,
    mesh: Mesh,
}

impl<B: RasterBackend> Objective<B> for Painted {
    fn loss(&self, theta: Tensor<B, 1>, _phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let count = self.mesh.positions().len();
        let device = theta.device();
        let part = |from: usize| theta.clone().narrow(0, from, 3 * count).reshape([1, count, 3]);
        let squares = self.views.iter().map(|v| v.view.mask.view_square().unwrap());
        let looks: Vec<_> = self.views.iter().zip(squares).collect();
        let cameras: Vec<Pinhole> = looks
            .iter()
            .map(|(v, [x, y, extent])| v.view.camera.cropped([*x, *y], [*extent; 2], SIZE))
            .collect();
        let moved = vertex_tensor::<B>(self.mesh.positions(), &device) + part(3 * count);
        let seen = project(moved, Pinholes::new(&cameras, &device));
        let renderer =
            ColourRenderer::new(self.mesh.faces(), SIZE, Family::Logistic, 0.05, [1.5, 4.5]);
        let renderer = renderer.with_tolerance(1e-9);
        let background = renderer.background(&[0.0; 3], &device);
        let attributes = Attributes::of_vertices(part(0), self.mesh.faces());
        let image = renderer.image(seen, &attributes, &background);
        PaintTargets::new(looks, SIZE).loss(image)
    }
}

#[test]
fn gradients_of_the_loss_to_colours_and_places_match_differences() {
    let mesh = icosphere(0);
    let views = all_around(false)[..2].to_vec();
    let count = 3 * mesh.positions().len();
    let theta: Vec<f64> = (0..2 * count)
        .map(|k| if k < count { 0.5 + 0.3 * (k as f64).sin() } else { 0.02 * (k as f64).cos() })
        .collect();
    let objective = Painted { views, mesh };
    check_gradient(&objective, &theta, &[]);
}
