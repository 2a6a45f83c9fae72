//! PLY files as programs write them, and invalid ones.

use softrast_mesh::Mesh;

const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
    element face 2\nproperty list uchar int vertex_indices\nend_header\n";
const POSITIONS: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.5], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// A quad and a triangle, with numbers in the byte order of `format`.
fn binary(format: &str, float: fn(f32) -> [u8; 4], int: fn(i32) -> [u8; 4]) -> Vec<u8> {
    let mut file = format!("ply\nformat {format} 1.0\n{HEADER}").into_bytes();
    for position in POSITIONS {
        file.extend(position.into_iter().flat_map(float));
        file.push(255);
    }
    for corners in [&[0, 1, 2, 3][..], &[2, 1, 0]] {
        file.push(corners.len() as u8);
        file.extend(corners.iter().copied().flat_map(int));
    }
    file
}

#[test]
fn text_and_both_byte_orders_say_the_same() {
    let text = format!(
        "ply\nformat ascii 1.0\ncomment made by hand\n{HEADER}0 0 .5 255\n1 0 0 0\n\n1 1 0 0\n0 1 0 7\n4 0 1 2 3\n3 2 1 0\n"
    );
    let little = binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes);
    let big = binary("binary_big_endian", f32::to_be_bytes, i32::to_be_bytes);
    for file in [text.clone().into_bytes(), text.replace('\n', "\r\n").into_bytes(), little, big] {
        let mesh = Mesh::parse(&file, "a.ply").unwrap();
        assert_eq!(mesh.positions(), POSITIONS.map(|p| p.map(f64::from)));
        assert_eq!(mesh.faces().len(), 3);
        assert_eq!(mesh.faces()[2], [2, 1, 0]);
        assert!(
            (mesh.area() - Mesh::parse(text.as_bytes(), "a.ply").unwrap().area()).abs() < 1e-12
        );
    }
}

#[test]
fn faces_may_come_first_and_other_elements_and_lists_are_skipped() {
    let file = "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar float uv\n\
        property list uint8 uint vertex_index\nproperty int flags\nelement edge 1\nproperty int a\n\
        element vertex 3\nproperty double nx\nproperty double z\nproperty double y\nproperty double x\n\
        end_header\n2 .5 .5 3 0 1 2 9\n4\n0 3 2 1\n0 6 5 4\n0 9 9 1e-3\n";
    let mesh = Mesh::parse(file.as_bytes(), "a.ply").unwrap();
    assert_eq!(mesh.positions(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [1e-3, 9.0, 9.0]]);
    assert_eq!(mesh.faces(), [[0, 1, 2]]);
}

/// Three vertices with these properties after x, y and z, and these words after their coordinates.
fn coloured(properties: &[&str], words: [&str; 3]) -> Result<Mesh, String> {
    let file = text_of(properties, words);
    Mesh::parse(file.as_bytes(), "a.ply").map_err(|error| error.to_string())
}

fn text_of(properties: &[&str], words: [&str; 3]) -> String {
    let properties: String = properties.iter().map(|p| format!("property {p}\n")).collect();
    let [a, b, c] = words;
    format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{properties}\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n3 0 1 2\n"
    )
}

#[test]
fn colours_are_bytes_shorts_or_floats() {
    let bytes = ["uchar red", "uchar green", "uchar blue", "uchar alpha"];
    let mesh = coloured(&bytes, ["255 0 51 255", "0 255 0 0", "102 102 102 9"]).unwrap();
    assert_eq!(mesh.colours().unwrap(), [[1.0, 0.0, 0.2], [0.0, 1.0, 0.0], [0.4; 3]]);
    let shorts = ["ushort diffuse_red", "ushort diffuse_green", "ushort diffuse_blue"];
    let mesh = coloured(&shorts, ["65535 0 13107"; 3]).unwrap();
    assert_eq!(mesh.colours().unwrap(), [[1.0, 0.0, 0.2]; 3]);
    // Between other properties, in another order.
    let floats = ["float nx", "double blue", "float red", "float ny", "float green"];
    let mesh = coloured(&floats, ["9 .25 1 9 0"; 3]).unwrap();
    assert_eq!(mesh.colours().unwrap(), [[1.0, 0.0, 0.25]; 3]);
    assert_eq!(mesh.positions()[1], [1.0, 0.0, 0.0]);
    // A single channel is not a colour.
    assert_eq!(coloured(&["uchar red"], ["7"; 3]).unwrap().colours(), None);
}

/// The red of the second vertex, and the warnings, of floats or whole numbers.
fn second_red(kind: &str, words: [&str; 3]) -> (Option<f64>, Vec<String>) {
    let properties = ["red", "green", "blue"].map(|channel| format!("{kind} {channel}"));
    let properties: Vec<&str> = properties.iter().map(String::as_str).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.ply");
    std::fs::write(&path, text_of(&properties, words)).expect("a file");
    let (mesh, warnings) = Mesh::load_textured(&path).expect("a mesh");
    let name = path.display().to_string();
    let warnings = warnings.iter().map(|warning| warning.to_string().replace(&name, "a.ply"));
    (mesh.colours().map(|colours| colours[1][0]), warnings.collect())
}

#[test]
fn colours_out_of_range_are_left_out_scaled_or_clamped_with_one_warning() {
    let left_out = |kind, word: &str, shown, full| {
        let words = ["0 0 0", &format!("{word} 0 0"), "0 0 0"];
        let message =
            format!("a.ply:14: colour {shown} is not from 0 to {full}: the colours are left out");
        assert_eq!(second_red(kind, words), (None, vec![message]));
    };
    for (word, shown) in [("1.5", "1.5"), ("-0.1", "-0.1"), ("nan", "NaN"), ("inf", "inf")] {
        left_out("float", word, shown, 1);
    }
    for word in ["-nan(ind)", "1.#QNAN", "red"] {
        left_out("double", word, "NaN", 1);
    }
    left_out("int", "300", "300", 255);
    left_out("int", "-2", "-2", 255);
    let (red, warnings) = second_red("float", ["0 0 0", "255 0 0", "0 128 0"]);
    let message = "colour 255 is not from 0 to 1: all colours are taken as levels from 0 to 255";
    assert_eq!((red, warnings), (Some(1.0), vec![format!("a.ply:14: {message}")]));
    let (red, warnings) = second_red("float", ["0 0 0", "1.0000001 0 0", "0 0 0"]);
    assert_eq!((red, warnings.len()), (Some(1.0), 1));
    assert_eq!(second_red("int", ["0 0 0", "256 0 0", "0 0 0"]).0, Some(1.0));
}

#[test]
fn values_after_those_of_the_header_are_skipped() {
    let file = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 2\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 255 255\n1 0 0\n0 1 0 .5 a word\n3 0 1 2 255 0 0\n3 2 1 0 3\n7 7 7\n";
    let mesh = Mesh::parse(file.as_bytes(), "a.ply").unwrap();
    assert_eq!(mesh.positions(), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(mesh.faces(), [[0, 1, 2], [2, 1, 0]]);
}

#[test]
fn lines_of_the_header_that_are_not_of_the_format_are_skipped() {
    let file = "ply\nformat ascii 1.0 \nMade by hand, see vertex and face\ncomment a\nobj_info num_cols 3\n\
        elements follow\nelement vertex 3\nproperty float x\nproperty float y\n\nproperty float z in metres\n\
        element face 1\nproperty list uchar int vertex_indices\nAuthor\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for file in [file.to_owned(), file.replace('\n', "\r\n")] {
        assert_eq!(Mesh::parse(file.as_bytes(), "a.ply").unwrap().faces(), [[0, 1, 2]]);
    }
}

#[test]
fn bad_files_are_one_line_that_names_the_place() {
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let whole = format!("{head}{body}");
    let with = |from: &str, to: &str| whole.replacen(from, to, 1);
    let little = binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes);
    let cases: [(Vec<u8>, &str); 15] = [
        (b"obj".to_vec(), "1: not a PLY file: its first line is not \"ply\""),
        (with("float z", "half z").into(), "6: \"half\" is not a type of PLY"),
        (
            with("ascii 1.0", "ascii 2.0").into(),
            "2: \"format ascii 2.0\" does not belong in the header of PLY 1.0",
        ),
        (
            with("format ascii 1.0\n", "").into(),
            "8: the header has no line that starts with format",
        ),
        (with("vertex 3", "vertex x").into(), "3: \"x\" is not a count"),
        (with("end_header\n", "").into(), "13: the file ends before end_header"),
        (with("property float z\n", "").into(), "3: element vertex has no number z"),
        (with("face 1", "face 0").into(), " no faces: a PLY file lists them in its element face"),
        (
            with("face 1", "face 900000000").into(),
            " element face: 900000000 do not fit into the 8 bytes after what is before",
        ),
        (
            with("0 1 0\n", "0 nan 0\n").into(),
            "12: coordinate \"NaN\" is not finite in 32-bit floats",
        ),
        (with("3 0 1 2", "2 0 1").into(), "13: fewer than three corners: found 2"),
        (with("3 0 1 2", "3 0 1 3").into(), "13: index 3 is out of range: the file has 3 vertices"),
        (with("3 0 1 2", "3 0 1 1.5").into(), "13: \"1.5\" is not a whole number"),
        (with("3 0 1 2", "3 0 1").into(), "13: the line ends before vertex_indices is complete"),
        (little[..little.len() - 1].to_vec(), " face 1: the file ends before it is complete"),
    ];
    for (file, message) in cases {
        let error = Mesh::parse(&file, "a.ply").expect_err(message).to_string();
        assert_eq!(error, format!("a.ply:{message}"));
    }
}
