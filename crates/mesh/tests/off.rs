//! OFF files as programs write them, and invalid ones.

use softrast_mesh::Mesh;

const SQUARE: &str = "0 0 0\n1 0 0\n1 1 .5\n\n0 1 0 # the last\n3 0 1 2\n4 0 1 2 3 255 0 0\n";

fn mesh(file: &str) -> Mesh {
    Mesh::parse(file.as_bytes(), "a.off").expect("a sound file")
}

#[test]
fn all_forms_of_the_first_lines_say_the_same() {
    for head in [
        "OFF\n4 2 5\n",
        "OFF 4 2 5\n",
        "OFF4 2 5\n",
        "# by hand\n\nOFF\r\n4 2\r\n",
        "STOFF\n4 2 0\n",
    ] {
        let mesh = mesh(&format!("{head}{SQUARE}"));
        assert_eq!(mesh.positions(), [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.5], [0., 1., 0.]]);
        assert_eq!(mesh.faces(), [[0, 1, 2], [0, 1, 2], [0, 2, 3]], "{head}");
        assert!(mesh.colours().is_none());
    }
}

#[test]
fn colours_stand_behind_positions_and_normals() {
    let faces = "3 0 1 2\n";
    let shares = format!("COFF\n3 1 0\n0 0 0 1 0 0 1\n1 0 0 0 .5 0 1\n0 1 0 0 0 1 1\n{faces}");
    let expected = [[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(mesh(&shares).colours().unwrap(), expected);
    let levels = format!(
        "CNOFF\n3 1 0\n0 0 0 0 0 1 255 0 0 255\n1 0 0 0 0 1 0 51 0 255\n0 1 0 0 0 1 0 0 255 255\n{faces}"
    );
    assert_eq!(mesh(&levels).colours().unwrap()[1], [0.0, 0.2, 0.0]);
    // Levels are as common as values from 0 to 1, so neither has a warning.
    let folder = tempfile::tempdir().unwrap();
    for (file, warnings) in [(&levels, 0), (&shares, 0), (&shares.replace(".5", "700"), 1)] {
        let path = folder.path().join("a.off");
        std::fs::write(&path, file).unwrap();
        assert_eq!(Mesh::load_textured(&path).unwrap().1.len(), warnings, "{file}");
    }
}

#[test]
fn bad_files_are_one_line_that_names_the_place() {
    let with = |line: &str| format!("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n{line}");
    for (file, message) in [
        (
            "",
            "a.off: no faces: an OFF file lists them after its vertices, as many as its second line says",
        ),
        (
            "OFF\n3 0 0\n",
            "a.off: no faces: an OFF file lists them after its vertices, as many as its second line says",
        ),
        ("v 0 0 0", "a.off:1: not an OFF file: it does not start with OFF"),
        ("OFF BINARY\n", "a.off:1: binary OFF files are not read: export it as text"),
        ("4OFF\n", "a.off:1: \"4OFF\" is not read: only three dimensions are"),
        ("OFF\n", "a.off: header: the file ends before it is complete"),
        ("OFF\nthree 1\n", "a.off:2: it should say how many vertices and faces there are"),
        ("OFF\n3 1 0\n0 0\n", "a.off:3: fewer than three coordinates: found 2"),
        ("OFF\n3 1 0\n0 0 x\n", "a.off:3: \"x\" is not a number"),
        ("OFF\n3 1 0\n0 0 1e99\n", "a.off:3: coordinate \"1e99\" is not finite in 32-bit floats"),
        ("OFF\n4000000000 1 0\n0 0 0\n", "a.off: vertex 1: the file ends before it is complete"),
        (&with(""), "a.off: face 0: the file ends before it is complete"),
        (&with("2 0 1"), "a.off:6: fewer than three corners: found 2"),
        (&with("x 0 1"), "a.off:6: \"x\" is not a whole number"),
        (&with("3 0 1"), "a.off:6: 3 corners, but the line has 2"),
        (&with("3 0 1 -1"), "a.off:6: index -1 is out of range: the file has 3 vertices"),
    ] {
        let error = Mesh::parse(file.as_bytes(), "a.off").unwrap_err().to_string();
        assert_eq!(error, message, "{file:?}");
    }
}
