//! Poses with a custom softness. `minimize` evaluates hard images in f32, as in programs, so this is not tested in f64.

use softrast_inverse::{
    InverseProblem, Method, PoseProblem, ScheduledSoftness, SolveConfig, minimize, pose::PoseSearch,
};
use softrast_raster::{Pinhole, Pinholes, hard_silhouette, project, vertex_tensor};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::{Arctan, lopsided_mesh};
use softrast_views::{Lens, Picture};

#[test]
fn poses_come_nearer_along_the_schedule_of_an_own_softness_and_of_its_surrogate() {
    let config = SolveConfig { size: 24, steps: 40, learning_rate: 2.0 };
    let problem = PoseProblem::new(&lopsided_mesh());
    let instances: Vec<_> = (0..8).map(|seed| problem.instance(seed).unwrap()).collect();
    let decay = ScheduledSoftness::decay(Arctan, 0.05, 0.002);
    for softness in [decay.clone(), decay.with_surrogate_scale(0.1)] {
        let method = Method::new("arctan", softness);
        let mut seen = Vec::new();
        minimize::<_, NdArray>(&problem, &instances, &method, &config, |iterate, _| {
            seen.push((iterate.hard_loss.iter().sum::<f64>() / 8.0, iterate.scale));
            Ok(())
        })
        .unwrap();
        let ((first, wide), (last, narrow)) = (seen[0], seen[seen.len() - 1]);
        assert!((wide - 0.05).abs() < 1e-12 && (narrow - 0.002).abs() < 1e-12);
        assert!(last < 0.9 * first, "{first} to {last}");
    }
}

#[test]
fn a_camera_is_found_by_a_mask_under_an_own_softness() {
    let (mesh, size) = (lopsided_mesh(), [48, 64]);
    let truth = Pinhole::look_at([2.0, 1.5, -2.5], [0.0; 3], [0.0, 1.0, 0.0], 45.0, size);
    let device = Default::default();
    let corners = vertex_tensor::<NdArray>(mesh.positions(), &device);
    let seen = project(corners, Pinholes::new(&[truth], &device));
    let silhouette: Tensor<NdArray, 3> = hard_silhouette(seen, mesh.faces(), size);
    let mask = Picture::new(silhouette.into_data().iter().collect(), size[1]);
    let camera = Lens::of_fov(45.0, mask.size()).pinhole(mask.size()).unwrap();
    let search = PoseSearch::new(&mesh, camera).with_fine_steps(30).with_fine_size(48);
    let method = Method::new("arctan", ScheduledSoftness::decay(Arctan, 0.05, 0.002));
    let found = search.with_method(method).run::<NdArray>(&mask).unwrap();
    assert!(found[0].iou > 0.95, "{}", found[0].iou);
}
