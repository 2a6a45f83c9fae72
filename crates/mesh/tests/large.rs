//! Small files of high cost: quadratic in their length, or copied many times.
//!
//! Reading each of them in quadratic time would take minutes.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs;

use serde_json::{Value, json};
use softrast_mesh::Mesh;

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |length: usize| (length as u32).to_le_bytes();
    let mut file = b"glTF".to_vec();
    file.extend([word(2), word(28 + json.len() + bin.len()), word(json.len())].concat());
    file.extend([b"JSON", json.as_slice(), &word(bin.len()), b"BIN\0", bin].concat());
    file
}

/// `vertices` points of one byte a coordinate and as many colours, in `faces` triangles, placed `copies` times.
fn copied(vertices: usize, faces: usize, copies: usize, colours: bool) -> Vec<u8> {
    let nodes: Vec<Value> = (0..copies).map(|_| json!({"mesh": 0})).collect();
    let mut attributes = json!({"POSITION": 0});
    if colours {
        attributes["COLOR_0"] = json!(2);
    }
    let json = json!({
        "scenes": [{"nodes": (0..copies).collect::<Vec<_>>()}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1}]}],
        "buffers": [{}],
        "bufferViews": [{"buffer": 0, "byteLength": 4 * vertices.max(faces)}],
        "accessors": [
            {"bufferView": 0, "componentType": 5120, "count": vertices, "type": "VEC3"},
            {"bufferView": 0, "componentType": 5121, "count": 3 * faces, "type": "SCALAR"},
            {"bufferView": 0, "componentType": 5121, "normalized": true, "count": vertices, "type": "VEC4"},
        ],
    });
    glb(&json, &vec![0; 4 * vertices.max(faces)])
}

#[test]
fn more_copies_than_memory_should_hold_are_one_line_before_any_is_made() {
    let error = |file: Vec<u8>| Mesh::parse(&file, "a.glb").err().unwrap().to_string();
    assert_eq!(
        error(copied(30_000, 10, 1000, false)),
        "a.glb: scene: its nodes place 30000000 vertices and 10000 faces, more than 20000000 with those of colours and textures counted \
         twice: export fewer copies"
    );
    assert!(error(copied(10, 30_000, 700, false)).contains("7000 vertices and 21000000 faces"));
    assert!(error(copied(30_000, 10, 400, true)).contains("12000000 vertices"));
    let mesh = Mesh::parse(&copied(3000, 10, 1000, true), "a.glb").unwrap();
    assert_eq!((mesh.positions().len(), mesh.faces().len()), (3_000_000, 10_000));
}

#[test]
fn empty_parts_that_are_placed_often_are_one_line() {
    let mut json = json!({"scenes": [{"nodes": (0..2000).collect::<Vec<_>>()}]});
    json["nodes"] = json!(vec![json!({"mesh": 0}); 2000]);
    for part in [json!({"attributes": {}}), json!({"attributes": {"POSITION": 0}, "mode": 0})] {
        json["meshes"] = json!([{"primitives": vec![part; 100_000]}]);
        let error = Mesh::parse(&glb(&json, &[]), "a.glb").err().unwrap().to_string();
        let expected = "a.glb: scene: its nodes place 200000000 parts of meshes, more than 1000000";
        assert_eq!(error, expected);
    }
}

#[test]
fn coordinates_that_many_accessors_repeat_leave_the_texture_out() {
    let (vertices, parts) = (30_000, 2000);
    let file = copied(vertices, 10, 1, false);
    let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    let mut json: Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
    let part = |k: usize| json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 3 + k}, "indices": 1});
    json["meshes"][0]["primitives"] = (0..parts).map(part).collect();
    let coordinates =
        json!({"bufferView": 0, "componentType": 5121, "count": vertices, "type": "VEC2"});
    json["accessors"].as_array_mut().unwrap().extend(vec![coordinates; parts]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, glb(&json, &file[28 + length..])).unwrap();
    let (mesh, warnings) = Mesh::load_textured(&path).unwrap();
    assert_eq!((mesh.positions().len(), mesh.faces().len()), (vertices, 10 * parts));
    let warning = warnings[0].to_string();
    assert!(warning.ends_with("with it there are more than 10000000 coordinates"), "{warning}");
    assert!(mesh.texture().is_none() && warnings.len() == 1);
}

#[test]
fn counts_that_the_file_cannot_hold_are_one_line() {
    let huge = 1u64 << 40;
    for (accessor, count) in [(0, huge), (1, huge), (0, u64::MAX), (1, 3 << 30)] {
        let file = copied(30, 10, 1, false);
        let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let mut json: Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
        json["accessors"][accessor]["count"] = json!(count);
        assert!(Mesh::parse(&glb(&json, &[0; 120]), "a.glb").is_err());
        // Entries without bytes.
        json["accessors"][accessor]["bufferView"] = json!(null);
        json["accessors"][accessor]["sparse"] = json!({
            "count": 1,
            "indices": {"bufferView": 0, "componentType": 5121},
            "values": {"bufferView": 0},
        });
        assert!(Mesh::parse(&glb(&json, &[0; 120]), "a.glb").is_err());
    }
    for counts in ["vertex 4000000000\n", "vertex 3\n"] {
        for face in ["element face 4000000000\n", "element face 18446744073709551615\n"] {
            for format in ["ascii", "binary_little_endian"] {
                let file = format!(
                    "ply\nformat {format} 1.0\nelement {counts}property float x\nproperty float y\nproperty float z\n\
                    {face}property list uint int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n4000000000 1 2 3\n"
                );
                assert!(Mesh::parse(file.as_bytes(), "a.ply").is_err());
            }
        }
    }
    let mut stl = vec![b' '; 134];
    stl[80..84].fill(255);
    let error = Mesh::parse(&stl, "a.stl").unwrap_err().to_string();
    assert!(error.starts_with("a.stl: header: 4294967295 triangles take"), "{error}");
}

#[test]
fn polygons_that_wind_many_times_are_cut_in_good_time() {
    let corners = 1023;
    let turn = |k: usize| (k as f64 * 122.0).to_radians();
    let vertices: String = (0..corners)
        .map(|k| format!("v {} {} 0\n", turn(k).cos() + k as f64 * 1e-4, turn(k).sin()))
        .collect();
    let polygon = |by: usize| {
        let words: String = (0..corners).map(|k| format!(" {}", (k * by) % corners + 1)).collect();
        format!("f{words}\n")
    };
    let polygons: String = [1, 2, 5, 64, 121, 500].map(polygon).concat();
    let file = format!("{vertices}{}", polygons.repeat(30));
    let mesh = Mesh::parse(file.as_bytes(), "a.obj").unwrap();
    assert_eq!(mesh.faces().len(), 180 * (corners - 2));
}

#[test]
fn a_polygon_of_a_hundred_thousand_corners_keeps_its_area() {
    // A comb of unit teeth, each as wide as the gap next to it.
    let teeth = 25_000;
    let tooth = |k: i32| [[2 * k, 0], [2 * k, 1], [2 * k + 1, 1], [2 * k + 1, 0]];
    let top: Vec<[i32; 2]> = (0..teeth).flat_map(tooth).collect();
    let bar = [[2 * teeth - 1, -1], [0, -1]];
    let corners: Vec<[i32; 2]> = [top.as_slice(), &bar].concat();
    let vertices: String = corners.iter().map(|[x, y]| format!("v {x} {y} 0\n")).collect();
    let words: String = (1..=corners.len()).map(|k| format!(" {k}")).collect();
    let mesh = Mesh::parse(format!("{vertices}f{words}\n").as_bytes(), "a.obj").unwrap();
    assert_eq!(mesh.area(), f64::from(teeth + 2 * teeth - 1));
}

#[test]
fn long_names_of_materials_on_many_faces_are_read_in_good_time() {
    let folder = tempfile::tempdir().unwrap();
    let name = "m".repeat(1 << 20);
    let faces = "f 1/1 1/1 1/1\n".repeat(100_000);
    let obj = format!("mtllib a.mtl\nv 0 0 0\nvt 0 0\nusemtl {name}\n{faces}");
    let mtl = format!("newmtl {name}\n{}", "map_Kd a.png\n".repeat(100_000));
    fs::write(folder.path().join("a.obj"), obj).unwrap();
    fs::write(folder.path().join("a.mtl"), mtl).unwrap();
    let (mesh, warnings) = Mesh::load_textured(folder.path().join("a.obj")).unwrap();
    assert_eq!(mesh.faces().len(), 100_000);
    let warnings: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("a.png: cannot be read"), "{warnings:?}");
}

#[test]
fn one_library_that_is_named_many_times_is_read_once() {
    let folder = tempfile::tempdir().unwrap();
    let square = "v 0 0 0\nvt 0 0\nf 1/1 1/1 1/1\n";
    let lines = ["mtllib a.mtl\n", "mtllib ./a.mtl\n", "mtllib x/../a.mtl\n"].concat();
    fs::write(folder.path().join("a.obj"), lines.repeat(20_000) + square).unwrap();
    fs::write(folder.path().join("a.mtl"), "newmtl a\n".repeat(300_000)).unwrap();
    let (mesh, warnings) = Mesh::load_textured(folder.path().join("a.obj")).unwrap();
    assert_eq!((mesh.faces().len(), warnings.len()), (1, 0));
}
