//! Every file in `tests/nasty` gives the result in `expected.json`.

use std::{fs, path::Path};

use serde_json::Value;
use softrast_mesh::{Mesh, MeshError};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/nasty");

#[test]
fn every_nasty_file_loads_or_fails_as_expected() {
    let text = fs::read_to_string(Path::new(FOLDER).join("expected.json")).unwrap();
    let expected: Value = serde_json::from_str(&text).unwrap();
    let files = expected.as_object().unwrap();
    assert_eq!(files.len(), 83);
    for (file, facts) in files {
        match (facts["outcome"].as_str().unwrap(), Mesh::load(Path::new(FOLDER).join(file))) {
            ("ok", Ok(mesh)) => check_mesh(file, facts, &mesh),
            ("either", Ok(mesh)) => check_mesh(file, &facts["if_ok"], &mesh),
            ("error" | "either", Err(error)) => check_error(file, facts, &error),
            (outcome, result) => panic!("{file}: expected {outcome}, found {result:?}"),
        }
    }
}

fn check_mesh(file: &str, facts: &Value, mesh: &Mesh) {
    let count = |name: &str, found: usize| {
        let expected = facts[name].as_u64();
        assert!(expected.is_none_or(|n| n == found as u64), "{file}: {found} {name}");
    };
    let close = |name: &str, found: f64| {
        let near = |expected: f64| (found - expected).abs() <= 1e-6 * expected.abs();
        assert!(facts[name].as_f64().is_none_or(near), "{file}: {name} is {found}");
    };
    count("vertices", mesh.positions().len());
    count("triangles", mesh.faces().len());
    let distinct = |[a, b, c]: &&[u32; 3]| a != b && b != c && c != a;
    count("triangles_distinct_indices", mesh.faces().iter().filter(distinct).count());
    close("area", mesh.area());
    close("volume", mesh.triangles().map(signed_volume).sum());
    if let Some(faces) = facts["faces"].as_array() {
        let found = mesh.faces().iter().map(|face| Value::from(face.to_vec()));
        assert_eq!(&found.collect::<Vec<_>>(), faces, "{file}");
    }
    let normalized = mesh.normalized();
    let inside = |p: &[f64; 3]| p.iter().all(|x| (-1.0..=1.0).contains(x));
    assert!(normalized.positions().iter().all(inside), "{file}: {normalized:?}");
    assert!(normalized.area().is_finite(), "{file}");
}

fn check_error(file: &str, facts: &Value, error: &MeshError) {
    let message = error.to_string();
    assert_eq!(message.lines().count(), 1, "{message}");
    let path = Path::new(FOLDER).join(file).display().to_string();
    let place = message.strip_prefix(&path).unwrap_or_else(|| panic!("{file}: {message}"));
    match facts["error_line"].as_u64() {
        Some(line) => assert!(place.starts_with(&format!(":{line}: ")), "{message}"),
        None => assert!(place.starts_with(": no faces"), "{message}"),
    }
    // "index out of range" must match "index 7 is out of range".
    let reason = facts["reason"].as_str().unwrap_or_default();
    let words = reason.split(' ').collect::<Vec<_>>();
    assert!(words.iter().all(|word| message.contains(word)), "{message}: expected {reason}");
}

/// Volume between a triangle and the origin, positive if its front faces away from it.
fn signed_volume([[ax, ay, az], [bx, by, bz], [cx, cy, cz]]: [[f64; 3]; 3]) -> f64 {
    (ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)) / 6.0
}
