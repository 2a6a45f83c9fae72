//! The generated meshes: equal to the committed files, and valid surfaces.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{collections::HashSet, path::Path};

use softrast_mesh::{Mesh, airplane, chair, fox, painted_fox};

/// Each with the least and the largest allowed volume.
fn generated() -> [(&'static str, Mesh, [f64; 2]); 3] {
    [
        ("fox", fox(), [0.3, 0.5]),
        ("airplane", airplane(), [0.015, 0.04]),
        ("chair", chair(), [0.025, 0.06]),
    ]
}

#[test]
fn committed_files_are_what_the_generators_make() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/meshes");
    for (name, mesh, _) in generated() {
        let file = Mesh::load(folder.join(name).with_extension("obj")).unwrap();
        assert_eq!(file, mesh, "{name}: run the example make_data");
    }
    let (painted, warnings) = Mesh::load_textured(folder.join("fox.glb")).unwrap();
    assert!(warnings.is_empty() && painted.texture().unwrap().picture().is_some());
    assert_eq!(painted.faces(), fox().faces(), "fox.glb: run the example make_data");
    let fox = fox();
    let off = |a: &[f64; 3], b: &[f64; 3]| (0..3).any(|k| (a[k] - b[k]).abs() > 1e-6);
    let mut pairs = painted.positions().iter().zip(fox.positions());
    assert!(!pairs.any(|(a, b)| off(a, b)), "fox.glb: run the example make_data");
}

#[test]
fn surfaces_are_closed_and_of_one_piece_without_handles() {
    for (name, mesh, _) in generated() {
        let sides = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)];
        let edges: HashSet<_> = mesh.faces().iter().flat_map(sides).collect();
        assert_eq!(edges.len(), 3 * mesh.faces().len(), "{name}: an edge is used twice one way");
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "{name}: an edge is open");
        let euler = mesh.positions().len() + mesh.faces().len() - edges.len() / 2;
        assert_eq!(euler, 2, "{name}");
    }
}

#[test]
fn faces_look_outward_and_few_are_slivers() {
    for (name, mesh, [least, most]) in generated() {
        let volume: f64 = mesh.triangles().map(|[a, b, c]| dot(a, cross(b, c)) / 6.0).sum();
        assert!((least..most).contains(&volume), "{name}: volume {volume}");
        let slivers = mesh.triangles().filter(|&corners| quality(corners) < 0.4).count();
        let faces = mesh.faces().len();
        assert!(50 * slivers < faces, "{name}: {slivers} slivers of {faces}");
        assert!((1500..=4000).contains(&faces), "{name}: {faces} faces");
    }
}

/// `4 √3 area / (sum of squared sides)`: 1 if equilateral, 0 without area.
fn quality([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let [u, v, w] = [difference(b, a), difference(c, b), difference(a, c)];
    2.0 * 3f64.sqrt() * dot(cross(u, v), cross(u, v)).sqrt() / (dot(u, u) + dot(v, v) + dot(w, w))
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

#[test]
fn the_fox_in_colours_is_the_fox_with_a_white_tail_tip_and_a_dark_nose() {
    let painted = painted_fox();
    assert_eq!(Mesh::new(painted.positions().to_vec(), painted.faces().to_vec()).unwrap(), fox());
    let colours = painted.colours().unwrap();
    let at = |key: fn(&[f64; 3]) -> f64| {
        let vertices = painted.positions().iter().zip(colours);
        *vertices.max_by(|(p, _), (q, _)| key(p).total_cmp(&key(q))).unwrap().1
    };
    let (nose, tail_tip) = (at(|p| -p[2]), at(|p| p[0] + p[1] + p[2]));
    assert!(nose.iter().all(|&x| x < 0.2), "{nose:?}");
    assert!(tail_tip.iter().all(|&x| x > 0.8), "{tail_tip:?}");
}
