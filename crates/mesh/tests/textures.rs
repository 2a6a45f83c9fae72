//! Textures in OBJ and GLB files: as programs write them, invalid ones, and after a round trip.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use serde_json::{Value, json};
use softrast_mesh::{Material, Mesh, Texture, icosphere};
use tempfile::TempDir;

/// Content with the signature of a PNG file; it is not decoded here.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n and so on";
const JPEG: &[u8] = b"\xff\xd8\xff\xe0 and so on";

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    folder
}

/// The mesh of a file, and its one warning, if any, without the name of the folder.
fn load(folder: &Path, name: &str) -> (Mesh, Option<String>) {
    let (mesh, mut warnings) = load_all(folder, name);
    assert!(warnings.len() <= 1, "{warnings:?}");
    (mesh, warnings.pop())
}

fn load_all(folder: &Path, name: &str) -> (Mesh, Vec<String>) {
    let path = folder.join(name);
    let (mesh, warnings) = Mesh::load_textured(&path).unwrap();
    let plain = Mesh::load(&path).unwrap();
    assert_eq!(plain.texture(), None);
    assert_eq!((plain.positions(), plain.faces()), (mesh.positions(), mesh.faces()));
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    let prefix = format!("{}/", folder.display());
    assert!(warnings.iter().all(|text| !text.contains(char::is_control)), "{warnings:?}");
    (mesh, warnings.iter().map(|text| text.replace(&prefix, "")).collect())
}

/// The coordinates of the corners of each face.
fn corners(mesh: &Mesh) -> Vec<[[f64; 2]; 3]> {
    let texture = mesh.texture().expect("a texture");
    let at = |k: u32| texture.coordinates()[k as usize];
    texture.corners().iter().map(|face| face.map(at)).collect()
}

#[test]
fn polygons_of_an_obj_file_keep_the_coordinates_of_their_corners() {
    // A concave polygon, whose first ear is not at its first corner; then a seam, and the latest coordinate.
    let obj = "v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\nvt 0 0\nvt 1 0 0.5\nvt .25 .25\nvt -2 1\nvt 9\n\
        f 2/2 3/3/1 4/4 1/1\nf 1/-1/7 2/5 3/2\n";
    let folder = folder(&[("a.obj", obj.as_bytes())]);
    let (mesh, left_out) = load(folder.path(), "a.obj");
    assert_eq!(left_out, None);
    assert_eq!(mesh.faces().len(), 3);
    for (face, uvs) in mesh.faces().iter().zip(corners(&mesh)).take(2) {
        for (vertex, [u, v]) in face.iter().zip(uvs) {
            let [x, y, _] = mesh.positions()[*vertex as usize];
            let expected = if x == 0.0 && y == 4.0 { [-2.0, 1.0] } else { [x / 4.0, y / 4.0] };
            assert_eq!([u, v], expected);
        }
    }
    assert_eq!(corners(&mesh)[2], [[9.0, 0.0], [9.0, 0.0], [1.0, 0.0]]);
    assert_eq!(mesh.texture().unwrap().picture(), None);
}

#[test]
fn the_picture_of_an_obj_file_is_that_of_its_materials() {
    let faces = "f 1/1 2/2 3/3\nusemtl dull paint\nf 1/1 3/3 4/4\n";
    let head = "mtllib lib/the paint.mtl\nusemtl shiny\n";
    let obj = format!("{head}{SQUARE}{faces}");
    let mtl = "newmtl dull paint\nKd .5 1 1\nmap_Kd maps\\a b.png\nnewmtl other\nmap_Kd c.png\n\
        newmtl shiny\nmap_kd maps\\a b.png\n";
    let folder = folder(&[
        ("a.obj", obj.as_bytes()),
        ("lib/the paint.mtl", mtl.as_bytes()),
        ("lib/maps/a b.png", PNG),
    ]);
    let (mesh, left_out) = load(folder.path(), "a.obj");
    assert_eq!(left_out, None);
    assert_eq!(mesh.texture().unwrap().picture(), Some(PNG));
}

#[test]
fn what_is_wrong_with_the_texture_of_an_obj_file_leaves_it_out_by_name() {
    let wrong = |faces: &str| load(folder(&[("a.obj", faces.as_bytes())]).path(), "a.obj");
    for (text, message) in [
        (
            "f 1/1 2/5 3/3",
            "a.obj:9: texture coordinate 5 is out of range: the file has 4, 4 of them before it",
        ),
        (
            "f 1/1 2/-5 3/3",
            "a.obj:9: texture coordinate -5 is out of range: the file has 4, 4 of them before it",
        ),
        (
            "f 1/1 2/0 3/x",
            "a.obj:9: texture coordinate 0 is out of range: the file has 4, 4 of them before it",
        ),
        (
            "f 1/1 2/2 3/99999999999999999999",
            "a.obj:9: texture coordinate 99999999999999999999 is out of range: the file has 4, 4 of them before it",
        ),
        ("vt 1 nan\nf 1/1 2/2 3/3", "a.obj:9: texture coordinate nan is not from -10000 to 10000"),
        ("vt 1e5 0\nf 1/1 2/2 3/3", "a.obj:9: texture coordinate 1e5 is not from -10000 to 10000"),
        ("vt a 0\nf 1/1 2/2 3/3", "a.obj:9: \"a\" is not a number"),
        ("vt\nf 1/1 2/2 3/3", "a.obj:9: a texture coordinate without a number"),
        (
            "f 1/1 2/2 3/3\nf 1/1 3//7 4/4",
            "a.obj:10: a corner has no texture coordinate, but one of line 9 has: all need one",
        ),
    ] {
        let (mesh, left_out) = wrong(&format!("{SQUARE}{text}\n"));
        assert_eq!(left_out.as_deref(), Some(message));
        assert_eq!(mesh.texture(), None);
    }
    // No corner has a coordinate, so none is missing.
    let (mesh, left_out) = wrong(&format!("{SQUARE}f 1 2 3\nf 1/ 3//1 4/\n"));
    assert_eq!((mesh.texture(), left_out), (None, None));
}

#[test]
fn a_picture_that_cannot_be_had_leaves_coordinates_and_says_why() {
    let mtl = |files: &[(&str, &[u8])], mtl: &str| {
        let obj = format!("mtllib a.mtl\n{SQUARE}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/4");
        let fixed = [("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes())];
        let folder = folder(&[files, &fixed[..if mtl.is_empty() { 1 } else { 2 }]].concat());
        let (mesh, left_out) = load(folder.path(), "a.obj");
        assert_eq!(corners(&mesh).len(), 2);
        assert_eq!(mesh.texture().unwrap().picture(), None);
        left_out
    };
    let both = |name: &str| format!("newmtl a\nmap_Kd {name}\nnewmtl b\nmap_Kd {name}");
    let starts = |found: Option<String>, start: &str| {
        assert!(found.as_ref().is_some_and(|text| text.starts_with(start)), "{found:?}");
    };
    starts(mtl(&[], ""), "a.mtl: cannot be read: ");
    starts(mtl(&[], &both("a.png")), "a.png: cannot be read: ");
    starts(mtl(&[], &both("/dev/zero")), "zero: cannot be read: ");
    starts(mtl(&[], &both("..")), ": cannot be read: it is a folder");
    let gif = mtl(&[("a.gif", b"GIF89a")], &both("a.gif"));
    starts(gif, "a.gif: cannot be read: it is neither a PNG nor a JPEG file");
    let empty = mtl(&[("a.png", b"")], &both("../../elsewhere/a.png"));
    starts(empty, "a.png: cannot be read: it is neither a PNG nor a JPEG file");
    let options = mtl(&[("a.png", PNG)], &both("-s 2 2 a.png"));
    starts(
        options,
        "a.obj: materials: map_Kd of \"a\" has options, which are not read: -s 2 2 a.png",
    );
    // The available one of two pictures is shown.
    let several = mtl(&[("a.png", PNG)], "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png");
    starts(several, "b.png: cannot be read: ");
    // Materials without pictures have colours.
    assert_eq!(mtl(&[], "newmtl a\nKd 1 0 0"), None);
}

#[test]
fn faces_of_an_obj_file_show_the_pictures_and_colours_of_their_materials() {
    let obj = format!(
        "mtllib a.mtl\n{SQUARE}f 1 2 3\nusemtl b\nf 1/1 2/2 3/3 4/4\nusemtl a\nf 1/4 2/3 3/2\n\
         usemtl red\nf 1 3 4\nusemtl c\nf 2/1 3/1 4/2\n"
    );
    let mtl = "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.jpg\nnewmtl red\nKd 1 0 .5\n\
               newmtl c\nmap_Kd a.png\n";
    let files: [(&str, &[u8]); 4] =
        [("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes()), ("a.png", PNG), ("b.jpg", JPEG)];
    let (mesh, warning) = load(folder(&files).path(), "a.obj");
    assert_eq!(warning, None);
    let texture = mesh.texture().unwrap();
    assert_eq!((texture.of_faces(), texture.picture()), (&[0, 1, 1, 2, 3, 2][..], None));
    let pictures: Vec<_> = texture.materials().iter().map(Material::picture).collect();
    assert_eq!(pictures, [None, Some(JPEG), Some(PNG), None]);
    let [red, green, blue] = texture.materials()[3].factor();
    assert!(red == 1.0 && green == 0.0 && (blue - 0.2140).abs() < 1e-4, "{blue}: half of sRGB");
    assert_eq!(corners(&mesh)[3], [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);

    // A picture cannot be placed on a corner without a coordinate.
    let spoiled = obj.replace("f 1/4 2/3 3/2", "f 1/4 2/3 3");
    let files = [("a.obj", spoiled.as_bytes()), files[1], files[2], files[3]];
    let (mesh, warning) = load(folder(&files).path(), "a.obj");
    assert_eq!(mesh.texture(), None);
    let expected =
        "a.obj:14: a corner has no texture coordinate, but its material \"a\" shows a picture";
    assert_eq!(warning.as_deref(), Some(expected));

    // Colours without any picture or coordinate; vertex colours take precedence.
    let plain = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    let painted = plain.replace(" 0 0\n", " 0 0 1 1 1\n").replace(" 1 0\n", " 1 0 1 1 1\n");
    for (text, factor) in [(plain, Some([1.0, 0.0, blue])), (painted.as_str(), None)] {
        let files = [("a.obj", text.as_bytes()), files[1]];
        let (mesh, warning) = load(folder(&files).path(), "a.obj");
        assert_eq!(warning, None);
        assert_eq!(mesh.texture().map(|texture| texture.materials()[0].factor()), factor);
    }
}

const FACES: &str = "usemtl picture\nf 1/1 2/2 3/3 4/4\n";

#[test]
fn a_line_may_name_several_libraries_and_names_may_hold_spaces() {
    let picture: (&str, &[u8]) = ("a.png", PNG);
    let plain: (&str, &[u8]) = ("plain.mtl", b"newmtl plain\nKd 1 1 1\n");
    let shown = b"newmtl picture\nmap_Kd a.png\n";
    for (line, library) in [
        ("plain.mtl b.mtl", "b.mtl"),
        ("b.mtl plain.mtl", "b.mtl"),
        ("plain.mtl my second.MTL", "my second.MTL"),
        ("my first.mtl plain.mtl", "my first.mtl"),
        ("old.mtl copy.mtl", "old.mtl copy.mtl"),
        ("materials", "materials"),
        ("my materials", "my materials"),
        ("plain.mtl materials", "materials"),
        ("plain.mtl\nmtllib b.mtl\nmtllib b.mtl", "b.mtl"),
    ] {
        let obj = format!("mtllib {line}\n{SQUARE}{FACES}");
        let folder = folder(&[("a.obj", obj.as_bytes()), plain, (library, shown), picture]);
        let (mesh, warning) = load(folder.path(), "a.obj");
        assert_eq!(warning, None, "{line}");
        assert_eq!(mesh.texture().unwrap().picture(), Some(PNG), "{line}");
    }
    // Words that are files are used if the whole text is not a file.
    let obj = format!("mtllib gone b\n{SQUARE}{FACES}");
    let folder = folder(&[("a.obj", obj.as_bytes()), ("b", shown), picture]);
    let (mesh, warning) = load(folder.path(), "a.obj");
    assert!(warning.unwrap().starts_with("gone: cannot be read: "));
    assert_eq!(mesh.texture().unwrap().picture(), Some(PNG));
}

#[test]
fn a_library_that_is_missing_is_one_warning_and_the_others_are_read() {
    for head in ["mtllib gone.mtl\nmtllib b.mtl\n", "mtllib b.mtl gone.mtl\n"] {
        let obj = format!("{head}{SQUARE}{FACES}");
        let files: [(&str, &[u8]); 3] = [
            ("a.obj", obj.as_bytes()),
            ("b.mtl", b"newmtl picture\nmap_Kd a.png\n"),
            ("a.png", PNG),
        ];
        let (mesh, warning) = load(folder(&files).path(), "a.obj");
        let warning = warning.unwrap();
        assert!(warning.starts_with("gone.mtl: cannot be read: "), "{warning}");
        assert_eq!(mesh.texture().unwrap().picture(), Some(PNG));
    }
}

#[test]
fn the_first_library_that_shows_a_picture_of_a_material_counts() {
    let obj = format!("mtllib z.mtl a.mtl\n{SQUARE}{FACES}");
    let files: [(&str, &[u8]); 5] = [
        ("a.obj", obj.as_bytes()),
        ("z.mtl", b"newmtl picture\nmap_Kd a.png\n"),
        ("a.mtl", b"newmtl picture\nmap_Kd a.jpg\n"),
        ("a.png", PNG),
        ("a.jpg", JPEG),
    ];
    let (mesh, warning) = load(folder(&files).path(), "a.obj");
    assert_eq!((mesh.texture().unwrap().picture(), warning), (Some(PNG), None));
}

#[test]
fn libraries_and_pictures_outside_of_the_folder_are_not_opened() {
    let obj = |library: &str| format!("mtllib {library}\n{SQUARE}{FACES}");
    let outside = "in/a.obj";
    let files = |text: &str| {
        folder(&[
            (outside, text.as_bytes()),
            ("b.mtl", b"newmtl picture\nmap_Kd a.png\n"),
            ("a.png", PNG),
        ])
    };
    let found = files(&obj("../b.mtl"));
    let (mesh, warning) = load(&found.path().join("in"), "a.obj");
    assert!(warning.unwrap().starts_with("b.mtl: cannot be read: "));
    assert_eq!(mesh.texture().unwrap().picture(), None);
    let absolute = format!("mtllib {}\n", found.path().join("b.mtl").display());
    let found = files(&format!("{absolute}{SQUARE}{FACES}"));
    assert!(load(&found.path().join("in"), "a.obj").1.unwrap().starts_with("b.mtl: "));
    let inside: (&str, &[u8]) = ("in/b.mtl", b"newmtl picture\nmap_Kd ../a.png\n");
    let found = folder(&[(outside, obj("b.mtl").as_bytes()), inside, ("a.png", PNG)]);
    assert!(load(&found.path().join("in"), "a.obj").1.unwrap().starts_with("a.png: cannot be"));
}

#[test]
fn libraries_without_end_are_read_up_to_a_hundred() {
    let names: String = (0..300).map(|k| format!(" {k}.mtl")).collect();
    let lines: String = (0..300).map(|k| format!("mtllib {k}.mtl\n")).collect();
    for head in [format!("mtllib{names}\n"), lines] {
        let obj = format!("{head}{SQUARE}{FACES}");
        let (mesh, warnings) = load_all(folder(&[("a.obj", obj.as_bytes())]).path(), "a.obj");
        assert_eq!(mesh.faces().len(), 2);
        let expected = "a.obj: materials: more than 100 libraries: the others are not read";
        assert_eq!((warnings.len(), warnings[0].as_str()), (101, expected));
    }
}

#[test]
fn signs_in_the_names_of_files_stay_out_of_warnings() {
    let obj = format!("mtllib a.mtl\n{SQUARE}{FACES}");
    let name = format!("newmtl picture\nmap_Kd \u{1b}[31m{}.png\n", "x".repeat(5000));
    let files: [(&str, &[u8]); 2] = [("a.obj", obj.as_bytes()), ("a.mtl", name.as_bytes())];
    let warning = load(folder(&files).path(), "a.obj").1.unwrap();
    assert!(warning.starts_with("\u{fffd}[31mx") && warning.len() < 1000, "{warning}");
}

type Change<'a> = &'a dyn Fn(&mut Value, &mut Vec<u8>);

/// A square in two parts that share vertices, coordinates and a picture; `change` modifies it.
fn glb(change: impl Fn(&mut Value, &mut Vec<u8>)) -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut bin = floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    bin.extend(floats(&[0.0, 0.75, 0.5, 0.75, 0.5, 0.0, 0.0, 0.0]));
    bin.extend([0, 1, 2, 0, 2, 3, 0, 0]);
    bin.extend(PNG);
    let part = |indices: u32| json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": indices, "material": 0});
    let mut json = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [part(2), part(3)]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5121, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "byteOffset": 3, "componentType": 5121, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 6},
            {"buffer": 0, "byteOffset": 88, "byteLength": PNG.len()},
        ],
    });
    change(&mut json, &mut bin);
    json["buffers"] = json!([{"byteLength": bin.len()}]);
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |length: usize| (length as u32).to_le_bytes();
    let mut file = b"glTF".to_vec();
    file.extend([word(2), word(28 + json.len() + bin.len()), word(json.len())].concat());
    file.extend([b"JSON", json.as_slice(), &word(bin.len()), b"BIN\0", &bin].concat());
    file
}

#[test]
fn the_texture_of_a_glb_file_has_v_up_and_its_picture() {
    let loaded = |files: &[(&str, &[u8])], change: Change| {
        let file = glb(change);
        let folder = folder(&[files, &[("a.glb", &file)]].concat());
        let (mesh, left_out) = load(folder.path(), "a.glb");
        assert_eq!(left_out, None);
        mesh
    };
    let embedded = loaded(&[], &|_, _| ());
    let expected = [[[0., 0.25], [0.5, 0.25], [0.5, 1.]], [[0., 0.25], [0.5, 1.], [0., 1.]]];
    assert_eq!(corners(&embedded), expected);
    assert_eq!(embedded.texture().unwrap().coordinates().len(), 4, "both parts share them");
    assert_eq!(embedded.texture().unwrap().picture(), Some(PNG));

    let uri = |uri: &'static str| {
        move |json: &mut Value, _: &mut Vec<u8>| json["images"] = json!([{"uri": uri}])
    };
    let beside = loaded(&[("maps/a.jpg", JPEG)], &uri("maps/a.jpg"));
    assert_eq!(beside.texture().unwrap().picture(), Some(JPEG));
    let coded = loaded(&[], &uri("data:image/jpeg;base64,/9j/4CBhbmQgc28gb24="));
    assert_eq!(coded.texture().unwrap().picture(), Some(JPEG));

    let bytes = loaded(&[], &|json, bin| {
        json["accessors"][1]["componentType"] = json!(5121);
        json["accessors"][1]["normalized"] = json!(true);
        bin[48..56].copy_from_slice(&[0, 255, 255, 255, 255, 0, 0, 51]);
    });
    assert_eq!(corners(&bytes)[1], [[0.0, 0.0], [1.0, 1.0], [0.0, 0.8]]);
    let second = loaded(&[], &|json, _| {
        for primitive in json["meshes"][0]["primitives"].as_array_mut().unwrap() {
            primitive["attributes"] = json!({"POSITION": 0, "TEXCOORD_1": 1, "TEXCOORD_0": "?"});
        }
        json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(1);
    });
    assert_eq!(second.texture(), embedded.texture());
    let mirrored = loaded(&[], &|json, _| json["nodes"][0]["scale"] = json!([-1, 1, 1]));
    assert_eq!(corners(&mirrored)[0], [[0., 0.25], [0.5, 1.], [0.5, 0.25]]);
    assert_eq!(mirrored.faces()[0], [0, 2, 1]);
    let plain = loaded(&[], &|json, _| json["materials"] = json!("none"));
    assert_eq!(corners(&plain), expected);
    assert_eq!(plain.texture().unwrap().picture(), None);
}

#[test]
fn what_is_wrong_with_the_texture_of_a_glb_file_leaves_it_out_by_name() {
    let part = "a.glb: mesh 0, primitive";
    let cases: [(Change, &str, bool); 14] = [
        (
            &|j, _| {
                drop(
                    j["meshes"][0]["primitives"][1]["attributes"]
                        .as_object_mut()
                        .unwrap()
                        .remove("TEXCOORD_0"),
                )
            },
            " 1: it shows image 0, but has no texture coordinates",
            false,
        ),
        (
            &|j, _| {
                drop(
                    j["meshes"][0]["primitives"][0]["attributes"]
                        .as_object_mut()
                        .unwrap()
                        .remove("TEXCOORD_0"),
                )
            },
            " 0: it shows image 0, but has no texture coordinates",
            false,
        ),
        (
            &|j, _| j["accessors"][1]["type"] = json!("VEC3"),
            " 0, accessor 1: texture coordinates are of type VEC2, not \"VEC3\"",
            false,
        ),
        (
            &|j, _| j["accessors"][1]["count"] = json!(9),
            " 0: 9 texture coordinates for 4 vertices",
            false,
        ),
        (
            &|j, _| j["accessors"][1]["count"] = json!(2),
            " 0: 2 texture coordinates for 4 vertices",
            false,
        ),
        (
            &|j, _| j["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(99),
            " 0, accessor 99: there is none",
            false,
        ),
        (
            &|_, bin| bin[52..56].copy_from_slice(&f32::NAN.to_le_bytes()),
            " 0, vertex 0: texture coordinate (0, NaN) is not from -10000 to 10000",
            false,
        ),
        (
            &|_, bin| bin[48..52].copy_from_slice(&1e30f32.to_le_bytes()),
            " 0, vertex 0: texture coordinate (1000000015047466200000000000000, 0.75) is not from -10000 to 10000",
            false,
        ),
        (
            &|j, _| {
                j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
                    json!({"KHR_texture_transform": {}})
            },
            " 0: KHR_texture_transform is not read: apply it to the coordinates",
            false,
        ),
        (
            &|j, _| j["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]),
            " 0: its texture has no image of PNG or JPEG",
            false,
        ),
        (&|j, _| j["images"] = json!([]), "image 0: it has no content", true),
        (
            &|j, _| j["images"][0]["bufferView"] = json!(0),
            "image 0: it is neither PNG nor JPEG",
            true,
        ),
        (
            &|j, _| j["bufferViews"][3]["byteLength"] = json!(1u64 << 40),
            "image 0: it reaches beyond its buffer",
            true,
        ),
        (
            &|j, _| j["images"] = json!([{"uri": "data:image/png;base64,?"}]),
            "image 0: its data URI is not base64: data:image/png;base64,?",
            true,
        ),
    ];
    for (change, message, coordinates) in cases {
        let file = glb(change);
        let (mesh, left_out) = load(folder(&[("a.glb", &file)]).path(), "a.glb");
        let expected =
            if coordinates { format!("a.glb: {message}") } else { format!("{part}{message}") };
        assert_eq!(left_out, Some(expected));
        assert_eq!(mesh.texture().is_some(), coordinates);
        assert_eq!(mesh.faces().len(), 2);
    }
    let file = glb(|json, _| json["images"] = json!([{"uri": "../none.png"}]));
    let (_, left_out) = load(folder(&[("a.glb", &file)]).path(), "a.glb");
    assert!(left_out.unwrap().starts_with("none.png: cannot be read: "));
}

#[test]
fn the_diffuse_picture_of_specular_and_glossy_materials_is_the_texture() {
    for required in [false, true] {
        for beside in [json!(null), json!({"baseColorTexture": {"index": 7}})] {
            let file = glb(|json, _| {
                let name = "KHR_materials_pbrSpecularGlossiness";
                json["materials"] = json!([{
                    "extensions": {name: {"diffuseTexture": {"index": 0}}},
                    "pbrMetallicRoughness": beside,
                }]);
                if required {
                    json["extensionsRequired"] = json!([name]);
                }
            });
            let (mesh, warning) = load(folder(&[("a.glb", &file)]).path(), "a.glb");
            assert_eq!((mesh.texture().unwrap().picture(), warning), (Some(PNG), None));
        }
    }
}

/// The part in two materials, the second with a picture in another file.
fn of_two_materials(change: impl Fn(&mut Value)) -> (Mesh, Option<String>) {
    let file = glb(|json, _| {
        json["meshes"][0]["primitives"][1]["material"] = json!(1);
        json["images"].as_array_mut().unwrap().push(json!({"uri": "a.jpg"}));
        json["textures"] = json!([{"source": 0}, {"source": 1}]);
        json["materials"] = json!([
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
            {"pbrMetallicRoughness":
                {"baseColorTexture": {"index": 1}, "baseColorFactor": [0.25, 0.5, 1.0, 1.0]}},
        ]);
        change(json);
    });
    load(folder(&[("a.glb", &file), ("a.jpg", JPEG)]).path(), "a.glb")
}

#[test]
fn parts_of_a_glb_file_have_pictures_and_factors_of_their_own() {
    let looks = |mesh: &Mesh| {
        let texture = mesh.texture().unwrap();
        let look = |&number: &u32| {
            let material = &texture.materials()[number as usize];
            (material.picture().map(<[u8]>::to_vec), material.factor())
        };
        texture.of_faces().iter().map(look).collect::<Vec<_>>()
    };
    let (png, jpeg) = (Some(PNG.to_vec()), Some(JPEG.to_vec()));
    let (white, blue) = ([1.0; 3], [0.25, 0.5, 1.0]);
    let (mesh, warning) = of_two_materials(|_| ());
    assert_eq!((looks(&mesh), warning), (vec![(png.clone(), white), (jpeg, blue)], None));
    assert!(!mesh.texture().unwrap().multiplies_colours());
    assert_eq!(mesh.texture().unwrap().coordinates().len(), 4, "both parts share them");

    // Only unreadable pictures are omitted.
    let (mesh, warning) = of_two_materials(|json| json["images"][1]["uri"] = json!("b.jpg"));
    assert_eq!(looks(&mesh), [(png.clone(), white), (None, blue)]);
    assert!(warning.unwrap().starts_with("b.jpg: cannot be read: "));

    // Without a picture the factor is in the vertex colours, unless others share these.
    let (mesh, warning) = of_two_materials(|json| {
        json["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"] = json!(null);
    });
    assert_eq!((looks(&mesh), warning), (vec![(png, white), (None, blue)], None));
    assert_eq!(mesh.colours(), None);
    let (mesh, _) = of_two_materials(|json| {
        for material in json["materials"].as_array_mut().unwrap() {
            material["pbrMetallicRoughness"] = json!({"baseColorFactor": [0, 1, 0, 1]});
        }
        json["meshes"][0]["primitives"][1]["attributes"] = json!({"POSITION": 0});
    });
    assert_eq!(mesh.colours(), Some(&[[0.0, 1.0, 0.0]; 4][..]));
    assert_eq!(looks(&mesh), [(None, white), (None, white)]);

    // Vertex colours multiply the picture.
    let (mesh, warning) = of_two_materials(|json| {
        for part in json["meshes"][0]["primitives"].as_array_mut().unwrap() {
            part["attributes"]["COLOR_0"] = json!(0);
        }
    });
    assert!(mesh.texture().unwrap().multiplies_colours());
    assert_eq!((mesh.colours().unwrap()[2], warning), ([1.0, 1.0, 0.0], None));
}

#[test]
fn several_materials_that_are_written_to_glb_come_back() {
    let ball = icosphere(1);
    let corners = ball.faces().to_vec();
    let places = ball.positions().iter().map(|p| [p[0], p[1]]).collect();
    let material = |picture: &[u8]| Material::default().with_picture(picture).unwrap();
    let red = Material::default().with_factor([1.0, 0.0, 0.0]).unwrap();
    let dim = material(PNG).with_factor([0.5; 3]).unwrap();
    let materials = vec![material(JPEG), red, dim, material(PNG)];
    let of_faces = (0..corners.len() as u32).map(|face| face % 3).collect();
    let texture = Texture::new(places, corners).unwrap();
    let texture = texture.with_materials(materials.clone(), of_faces).unwrap();
    let plain = ball.with_texture(texture.clone()).unwrap();
    let colours = plain.positions().iter().map(|p| p.map(f64::abs)).collect();
    let painted = plain.clone().with_colours(colours).unwrap();
    let painted = painted.with_texture(texture.multiplying_colours()).unwrap();
    for mesh in [plain, painted] {
        let folder = folder(&[("a.glb", &mesh.to_glb())]);
        let (found, warning) = load(folder.path(), "a.glb");
        assert_eq!(warning, None);
        let texture = found.texture().unwrap();
        // Faces are sorted by material, and the unused material is removed.
        assert_eq!(texture.materials(), &materials[..3]);
        let expected: Vec<u32> = (0..80).map(|face| face / 27).collect();
        assert_eq!(texture.of_faces(), expected);
        assert_eq!(found.colours().is_some(), mesh.colours().is_some());
        assert_eq!(texture.multiplies_colours(), mesh.colours().is_some());
        // Triangles 0, 3, 6 and so on come first.
        for (k, triangle) in mesh.triangles().enumerate() {
            let other = found.triangles().nth((k % 3 * 27) + k / 3).unwrap();
            let pairs = triangle.as_flattened().iter().zip(other.as_flattened());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-7), "face {k}");
        }
    }
}

#[test]
fn a_required_extension_that_is_not_read_is_a_warning_or_an_error() {
    let requiring = |names: &[&str]| glb(|json, _| json["extensionsRequired"] = json!(names));
    for name in ["KHR_materials_transmission", "KHR_texture_transform", "EXT_texture_webp"] {
        let file = requiring(&["KHR_mesh_quantization", name]);
        let (mesh, warning) = load(folder(&[("a.glb", &file)]).path(), "a.glb");
        assert_eq!(mesh.texture().unwrap().picture(), Some(PNG));
        let expected = format!(
            "a.glb: JSON: needs the extension {name}, which is not read: the mesh may look different"
        );
        assert_eq!(warning, Some(expected));
    }
    for name in [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "EXT_mesh_gpu_instancing",
        "ACME_holes",
    ] {
        let error = Mesh::parse(&requiring(&["KHR_materials_unlit", name]), "a.glb").unwrap_err();
        let message = error.to_string();
        assert!(message.starts_with("a.glb: JSON: ") && message.contains(name), "{message}");
    }
}

/// A ball with a seam: faces of its right half have separate coordinates.
fn ball() -> Mesh {
    let ball = icosphere(1);
    let flat = |[x, y, _]: [f64; 3], side: f64| [side + x / 4.0, 0.5 + y / 2.0];
    let sides = [0.25, 0.75].map(|side| ball.positions().iter().map(move |&p| flat(p, side)));
    let count = ball.positions().len() as u32;
    let corners = ball.faces().iter().map(|face| {
        let right = face.iter().any(|&v| ball.positions()[v as usize][2] > 0.5);
        face.map(|v| v + if right { count } else { 0 })
    });
    let texture = Texture::new(sides.into_iter().flatten().collect(), corners.collect()).unwrap();
    let colours = ball.positions().iter().map(|p| p.map(f64::abs)).collect();
    let texture = texture.with_picture(PNG.to_vec()).unwrap();
    ball.with_colours(colours).unwrap().with_texture(texture).unwrap()
}

#[test]
fn a_texture_that_is_written_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    for name in ["a.obj", "a.glb", "a.ply"] {
        ball.save(folder.path().join(name)).unwrap();
    }
    let (obj, left_out) = load(folder.path(), "a.obj");
    assert_eq!(left_out, None);
    let [written, found] = [&ball, &obj].map(|mesh| mesh.texture().unwrap());
    assert_eq!((found.coordinates(), found.corners()), (written.coordinates(), written.corners()));
    assert_eq!(found.picture(), None, "OBJ has no room for it");
    assert_eq!((obj.positions(), obj.colours()), (ball.positions(), ball.colours()));

    let (glb, left_out) = load(folder.path(), "a.glb");
    assert_eq!(left_out, None);
    assert_eq!(glb.texture().unwrap().picture(), Some(PNG));
    assert!(glb.positions().len() > ball.positions().len(), "vertices on the seam are doubled");
    assert_eq!(glb.colours(), None, "others would show the product of colours and texture");
    let off = |a: f64, b: f64| assert!((a - b).abs() < 1e-7, "{a} and {b}");
    for (a, b) in glb.triangles().zip(ball.triangles()) {
        a.as_flattened().iter().zip(b.as_flattened()).for_each(|(&a, &b)| off(a, b));
    }
    for (a, b) in corners(&glb).iter().zip(&corners(&ball)) {
        a.as_flattened().iter().zip(b.as_flattened()).for_each(|(&a, &b)| off(a, b));
    }
    assert_eq!(load(folder.path(), "a.ply").0.texture(), None, "PLY leaves it out");
    // Once more, now that vertices are split.
    glb.save(folder.path().join("b.glb")).unwrap();
    assert_eq!(load(folder.path(), "b.glb").0, glb);
}
