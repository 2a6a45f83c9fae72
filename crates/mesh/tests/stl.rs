//! STL files as programs write them, and invalid ones.

use softrast_mesh::Mesh;

const TETRAHEDRON: [[[f32; 3]; 3]; 4] = {
    let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    [[o, y, x], [o, x, z], [o, z, y], [x, y, z]]
};

fn text(name: &str) -> String {
    let facet = |corners: &[[f32; 3]; 3]| {
        let vertices = corners.map(|[x, y, z]| format!("  vertex {x} {y} {z:e}\n")).concat();
        format!(" facet normal nan 0 0\n outer loop\n{vertices} endloop\n endfacet\n")
    };
    let facets: String = TETRAHEDRON.iter().map(facet).collect();
    format!("solid{name}\n{facets}endsolid{name}\n")
}

fn binary(head: &[u8]) -> Vec<u8> {
    let mut file = [head, &vec![b' '; 80 - head.len()]].concat();
    file.extend(4u32.to_le_bytes());
    for corners in TETRAHEDRON {
        file.extend([f32::NAN; 3].into_iter().chain(corners.concat()).flat_map(f32::to_le_bytes));
        file.extend([7, 7]);
    }
    file
}

#[test]
fn corners_at_one_place_are_one_vertex_in_text_and_binary() {
    let padded = [binary(b"made by hand"), vec![0; 3]].concat();
    let files = [
        text(" a solid thing").into_bytes(),
        text("").to_uppercase().replace('\n', "\r\n").into_bytes(),
        binary(b"made by hand"),
        // Many programs start binary files like text ones.
        binary(b"solid facet normal"),
        padded,
    ];
    for file in files {
        let mesh = Mesh::parse(&file, "a.STL").unwrap();
        assert_eq!(mesh.positions().len(), 4);
        assert_eq!(mesh.faces(), [[0, 1, 2], [0, 2, 3], [0, 3, 1], [2, 1, 3]]);
    }
}

#[test]
fn solids_of_one_file_are_one_mesh() {
    let mesh = Mesh::parse((text(" a") + &text(" b")).as_bytes(), "a.stl").unwrap();
    assert_eq!((mesh.positions().len(), mesh.faces().len()), (4, 8));
}

#[test]
fn words_that_end_a_part_may_be_two() {
    let whole = text(" a thing");
    for (from, to) in [
        ("endloop", "end loop"),
        ("endfacet", "End\tFacet"),
        ("endsolid", "END   SOLID"),
        ("end", "end "),
    ] {
        let file = whole.replace(from, to);
        let mesh = Mesh::parse(file.as_bytes(), "a.stl").unwrap();
        assert_eq!((mesh.positions().len(), mesh.faces().len()), (4, 4), "{file}");
    }
}

#[test]
fn the_name_of_a_solid_may_have_any_words_and_stand_twice() {
    let once = text(" a facet vertex endsolid solid thing");
    let twice = format!("solid a\n{}endsolid a\n", text(" a"));
    let lines = once.replacen('\n', "\nof several lines\n\nwith words\n", 1);
    let unclosed = text(" a").replace("endsolid a\n", "") + &text(" b");
    for (file, faces) in [(once, 4), (twice.clone(), 4), (lines, 4), (unclosed, 8)] {
        let mesh = Mesh::parse(file.as_bytes(), "a.stl").unwrap();
        assert_eq!((mesh.positions().len(), mesh.faces().len()), (4, faces), "{file}");
    }
    let marked = [b"\xef\xbb\xbf", twice.repeat(3).as_bytes()].concat();
    let mesh = Mesh::parse(&marked, "a.stl").unwrap();
    assert_eq!((mesh.positions().len(), mesh.faces().len()), (4, 12));
}

#[test]
fn bad_files_are_one_line_that_names_the_place() {
    let whole = text("");
    let with = |from: &str, to: &str| whole.replacen(from, to, 1).into_bytes();
    let mut bad_number = binary(b"");
    bad_number[84 + 50 + 12..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let cases: [(Vec<u8>, &str); 10] = [
        (b"v 0 0 0".to_vec(), " header: neither text that starts with solid nor 84 bytes long: 7"),
        (binary(b"")[..200].to_vec(), " header: 4 triangles take 284 bytes, but the file has 200"),
        (bad_number, " triangle 1: coordinate \"inf\" is not finite in 32-bit floats"),
        (
            b"solid a\nendsolid a\n".to_vec(),
            " no faces: an STL file is a list of triangles, this one is empty",
        ),
        (with("vertex 0 0 0e0", "vertex 0 0"), "4: fewer than three coordinates: found 2"),
        (with("vertex 0 0 0e0", "vertex 0 0 1,5"), "4: \"1,5\" is not a number"),
        (with("  vertex 0 0 0e0\n", ""), "7: a facet has three corners: found 2"),
        (with("outer loop", "outer loop\n facet"), "4: \"facet\" does not belong here"),
        (with("endsolid", ""), "30: the file ends before endsolid"),
        (whole.as_bytes()[..40].to_vec(), "3: the file ends before endfacet"),
    ];
    for (file, message) in cases {
        let error = Mesh::parse(&file, "a.stl").expect_err(message).to_string();
        assert_eq!(error, format!("a.stl:{message}"));
    }
}
