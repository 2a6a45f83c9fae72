//! OBJ files as programs write them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use softrast_mesh::Mesh;

/// The red of the second of three vertices, and the warnings.
fn second_red(colours: [&str; 3]) -> (Option<f64>, Vec<String>) {
    let [a, b, c] = colours;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, format!("v 0 0 0 {a}\nv 1 0 0 {b}\nv 0 1 0 {c}\nf 1 2 3\n")).unwrap();
    let (mesh, warnings) = Mesh::load_textured(&path).unwrap();
    assert_eq!(mesh.positions(), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let name = path.display().to_string();
    let warnings = warnings.iter().map(|warning| warning.to_string().replace(&name, "a.obj"));
    (mesh.colours().map(|colours| colours[1][0]), warnings.collect())
}

#[test]
fn colours_out_of_range_are_left_out_scaled_or_clamped_with_one_warning() {
    for (word, shown) in [
        ("nan", "NaN"),
        ("-nan(ind)", "NaN"),
        ("red", "NaN"),
        ("1e999", "inf"),
        ("1.5", "1.5"),
        ("-3", "-3"),
        ("65535", "65535"),
    ] {
        let found = second_red(["0 0 0", &format!("{word} 0 0"), &format!("0 0 {word}")]);
        let message = format!("colour {shown} is not from 0 to 1: the colours are left out");
        assert_eq!(found, (None, vec![format!("a.obj:2: {message}")]));
    }
    for levels in [["0 0 0", "255 0 0", "0 128 0"], ["0 0 0", "255 12.5 0", "0 0 0"]] {
        let (red, warnings) = second_red(levels);
        let message =
            "colour 255 is not from 0 to 1: all colours are taken as levels from 0 to 255";
        assert_eq!((red, warnings), (Some(1.0), vec![format!("a.obj:2: {message}")]));
    }
    let (red, warnings) = second_red(["0 0 0", "1.0000001 0 0", "-1e-9 0 0"]);
    let message = "colour 1.0000001 is not from 0 to 1: it is clamped, and so are others";
    assert_eq!((red, warnings), (Some(1.0), vec![format!("a.obj:2: {message}")]));
    assert_eq!(second_red(["0 0 0", "0.5 1 0", "1 0 0"]), (Some(0.5), vec![]));
}

#[test]
fn colours_of_some_vertices_alone_are_no_colours_and_no_warning() {
    assert_eq!(second_red(["0 0 255", "", "0 0 0"]), (None, vec![]));
}
