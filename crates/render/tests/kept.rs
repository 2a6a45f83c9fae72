//! The program does not touch files that it has not created.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::{fs, path::Path};

use image::{GrayImage, Luma};
use kept::{OCTAHEDRON, Program, SOFTNESS};

const RENDER: Program =
    Program { path: env!("CARGO_BIN_EXE_render"), inputs, short: "--size 8 --repeat 1" };

/// A triangle with a texture as a glTF file, with its numbers in `scene.bin` and its picture in `skin two.png`.
const SCENE: &str = r#"{
    "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0 }] }],
    "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
    "textures": [{ "source": 0 }], "images": [{ "uri": "skin%20two.png" }],
    "accessors": [
        { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
        { "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2" }
    ],
    "bufferViews": [
        { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
        { "buffer": 0, "byteOffset": 36, "byteLength": 24 }
    ],
    "buffers": [{ "uri": "scene.bin", "byteLength": 60 }]
}"#;

fn inputs(folder: &Path) {
    let path = |name: &str| folder.join(name);
    let textured = "mtllib skin.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n";
    for (name, text) in [
        ("mesh.obj", OCTAHEDRON),
        ("softness.json", SOFTNESS),
        ("textured.obj", textured),
        ("skin.mtl", "newmtl a\nmap_Kd skin.png\n"),
        ("notes.txt", "mine"),
        ("scene.gltf", SCENE),
    ] {
        fs::write(path(name), text).unwrap();
    }
    let numbers = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    fs::write(path("scene.bin"), numbers.map(f32::to_le_bytes).concat()).unwrap();
    let picture = GrayImage::from_fn(8, 8, |x, _| Luma([30 * x as u8]));
    for name in ["skin.png", "other.png", "target.png", "photo.jpg", "skin two.png"] {
        picture.save(path(name)).unwrap();
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("mesh.obj", path("link.png")).unwrap();
        fs::hard_link(path("target.png"), path("same.png")).unwrap();
    }
}

const LINES: &[(&str, &str)] = &[
    ("mesh.obj --out new.png", ""),
    ("textured.obj --colour --out new/er.png", ""),
    ("mesh.obj --out mesh.obj", "mesh.obj is an input of this run"),
    ("mesh.obj --out=./mesh.obj", "mesh.obj is an input of this run"),
    ("mesh.obj --out notes.txt", "notes.txt exists and is not a PNG picture"),
    ("mesh.obj --out photo.jpg", "photo.jpg exists and is not a PNG picture"),
    ("mesh.obj --out textured.obj", "is not a PNG picture"),
    (
        "mesh.obj --softness softness.json --out softness.json",
        "softness.json is an input of this run",
    ),
    ("mesh.obj --target target.png --out target.png", "target.png is an input of this run"),
    (
        "textured.obj --colour --texture other.png --out other.png",
        "other.png is an input of this run",
    ),
    ("textured.obj --colour --out skin.png", "skin.png is an input of this run"),
    ("textured.obj --colour --out skin.mtl", "skin.mtl is an input of this run"),
    ("scene.gltf --colour --out new.png", ""),
    ("scene.gltf --colour --out scene.bin", "scene.bin is an input of this run"),
    ("scene.gltf --colour --out 'skin_two.png'", "skin two.png is an input of this run"),
    #[cfg(unix)]
    ("mesh.obj --out link.png", "link.png is an input of this run"),
    #[cfg(unix)]
    ("mesh.obj --target target.png --out same.png", "same.png is an input of this run"),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    RENDER.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    RENDER.every_flag_is_in(&[""], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    RENDER.prints_no_control_codes(&[
        "IN/mesh.obj --out IN/out.png",
        "IN/mesh.obj --json --out IN/out.png",
        "IN/none-mesh.obj --out IN/out.png",
        "IN/mesh.obj --target IN/none-mesh.obj --out IN/out.png",
        "IN/mesh.obj --colour --texture IN/none-mesh.obj --out IN/out.png",
    ]);
}
