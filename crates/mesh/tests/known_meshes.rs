//! Well-known meshes of the field load with their published sizes.
//!
//! They are not part of this repository: `SOFTRAST_MESHES` names the folder that holds them.

use std::{env, path::Path};

use softrast_mesh::Mesh;

/// File, vertices and faces.
const KNOWN: [(&str, usize, usize); 10] = [
    ("paper/airplane.obj", 1352, 2700),
    ("paper/chair_1.obj", 642, 1280),
    ("paper/sphere_212.obj", 212, 420),
    ("paper/sphere_3076.obj", 3076, 6144),
    ("paper/spot.obj", 2930, 5856),
    ("extra/armadillo_20k.obj", 10002, 20000),
    ("extra/bunny.obj", 3301, 6598),
    ("extra/dragon_stanford_20k.obj", 10000, 20000),
    ("extra/spot_control_mesh.obj", 188, 372),
    ("extra/teapot.obj", 1292, 2464),
];

#[test]
#[ignore = "needs the paper's meshes"]
fn known_meshes_load_with_their_known_sizes() {
    let folder = env::var_os("SOFTRAST_MESHES")
        .expect("SOFTRAST_MESHES names the folder that holds paper/spot.obj and others");
    for (file, vertices, faces) in KNOWN {
        let mesh = Mesh::load(Path::new(&folder).join(file)).unwrap();
        assert_eq!((mesh.positions().len(), mesh.faces().len()), (vertices, faces), "{file}");
        let [low, high] = mesh.normalized().bounds();
        let sides = [0, 1, 2].map(|k| high[k] - low[k]);
        assert_eq!(sides.into_iter().fold(0.0, f64::max), 2.0, "{file}: {sides:?}");
    }
}
