//! The readers of mesh files, each with valid seed files, and the checks of their results.

use std::{fs, path::Path};

use serde_json::{Value, json};
use softrast_mesh::{Mesh, MeshError, Texture, icosphere};

/// A reader under test. The names of its files in `found` start with `name`.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) ending: &'static str,
    pub(crate) seeds: fn() -> Vec<Vec<u8>>,
    /// Reads a file; it may write into the folder.
    pub(crate) read: fn(&[u8], &Path),
}

pub(crate) fn all() -> Vec<Kind> {
    vec![
        Kind { name: "obj", ending: "obj", seeds: objs, read: |bytes, _| parsed(bytes, "a.obj") },
        Kind { name: "stl", ending: "stl", seeds: stls, read: |bytes, _| parsed(bytes, "a.stl") },
        Kind { name: "ply", ending: "ply", seeds: plys, read: |bytes, _| parsed(bytes, "a.ply") },
        Kind { name: "off", ending: "off", seeds: offs, read: |bytes, _| parsed(bytes, "a.off") },
        Kind { name: "glb", ending: "glb", seeds: glbs, read: |bytes, _| parsed(bytes, "a.glb") },
        Kind {
            name: "gltf",
            ending: "json",
            seeds: jsons,
            read: |bytes, _| parsed(&glb(bytes, &bin()), "a.glb"),
        },
        Kind { name: "textured-obj", ending: "obj", seeds: objs, read: textured_obj },
        Kind { name: "mtl", ending: "mtl", seeds: mtls, read: textured_mtl },
        Kind {
            name: "textured-gltf",
            ending: "json",
            seeds: jsons,
            read: |bytes, folder| loaded(&glb(bytes, &bin()), folder, "a.glb"),
        },
        Kind { name: "gltf-file", ending: "gltf", seeds: gltf_files, read: gltf_file },
    ]
}

/// Reads a mesh from bytes and checks it.
fn parsed(bytes: &[u8], name: &str) {
    check(Mesh::parse(bytes, name).map(|mesh| (mesh, vec![])));
}

/// Reads a mesh from a file, with its texture, and checks both.
fn loaded(bytes: &[u8], folder: &Path, name: &str) {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("a file in the folder");
    check(Mesh::load_textured(&path));
}

/// Checks the guarantees of every mesh and every error.
fn check(result: Result<(Mesh, Vec<MeshError>), MeshError>) {
    let one_line = |error: &MeshError| {
        let message = error.to_string();
        let short = message.chars().count() < 1500;
        assert!(short && !message.contains(char::is_control), "{message:?}");
    };
    match result {
        Ok((mesh, warnings)) => {
            warnings.iter().for_each(one_line);
            assert!(warnings.len() < 200, "{} warnings", warnings.len());
            let finite = |x: &f64| (*x as f32).is_finite();
            assert!(mesh.positions().as_flattened().iter().all(finite), "positions");
            let vertices = mesh.positions().len();
            assert!(mesh.faces().as_flattened().iter().all(|&v| (v as usize) < vertices), "faces");
            if let Some(colours) = mesh.colours() {
                assert_eq!(colours.len(), vertices);
                let share = |x: &f64| (0.0..=1.0).contains(x);
                assert!(colours.as_flattened().iter().all(share), "colours");
            }
            if let Some(texture) = mesh.texture() {
                assert_eq!(texture.corners().len(), mesh.faces().len());
                let count = texture.coordinates().len();
                let corners = texture.corners().as_flattened();
                assert!(corners.iter().all(|&k| (k as usize) < count), "corners");
            }
            assert!(mesh.area().is_finite());
        }
        Err(error) => one_line(&error),
    }
}

const SQUARE: &str = "mtllib a.mtl my b.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 .5 0\nv 1 1 0 0 0 1\nv 0 1 .5 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    usemtl picture\nf 1/1 2/2 3/3 4/4\n";
const LIBRARY: &str =
    "newmtl picture\nKd 1 .5 0\nmap_Kd a.png\nnewmtl plain\nmap_Kd maps\\a b.png\n";

fn textured_obj(bytes: &[u8], folder: &Path) {
    beside(folder);
    fs::write(folder.join("a.mtl"), LIBRARY).expect("a file in the folder");
    loaded(bytes, folder, "a.obj");
}

fn textured_mtl(bytes: &[u8], folder: &Path) {
    beside(folder);
    fs::write(folder.join("a.mtl"), bytes).expect("a file in the folder");
    loaded(SQUARE.as_bytes(), folder, "a.obj");
}

/// Creates files that materials refer to.
fn beside(folder: &Path) {
    if !folder.join("a.png").exists() {
        fs::write(folder.join("a.png"), b"\x89PNG\r\n\x1a\n").expect("a file in the folder");
        fs::write(folder.join("my b.mtl"), "newmtl other\nmap_Kd b.png\n").expect("a file");
    }
}

fn objs() -> Vec<Vec<u8>> {
    let comb = "v 0 0 0\nv 9 0 0\nv 9 3 0\nv 8 1 0\nv 6 1 0\nv 5 3 0\nv 4 1 0\nv 2 1 0\nv 1 3 0\nf 1 2 3 4 5 6 7 8 9\n";
    let forms = "# made by hand\r\no a\ng b\nv 1e0 .5 -2\nvn 0 0 1\nf 2//9 +3// -1\nv 0 0 0 1\nv 1 \\\n1 1\nl 1 2\nf -3 -2 -1\n";
    let levels = "v 0 0 0 255 128 0\nv 2 0 0 0 0 0\nv 0 2 0 12 7 255\nf 1 3 2\nf 1/ 2// 3\n";
    vec![
        SQUARE.into(),
        comb.into(),
        forms.into(),
        levels.into(),
        icosphere(1).to_obj().into_bytes(),
        textured().to_obj().into_bytes(),
    ]
}

fn mtls() -> Vec<Vec<u8>> {
    vec![LIBRARY.into(), "newmtl picture\r\nmap_kd ./maps/../a.png\r\n".into()]
}

fn text_of_stl(name: &str, ends: [&str; 3]) -> String {
    let [end_loop, end_facet, end_solid] = ends;
    let ball = icosphere(0);
    let facets = ball.triangles().map(|corners| {
        let vertices = corners.map(|[x, y, z]| format!("vertex {x} {y} {z:e}\n")).concat();
        format!("facet normal nan 0 0\nouter loop\n{vertices}{end_loop}\n{end_facet}\n")
    });
    let facets: String = facets.collect();
    format!("solid {name}\n{facets}{end_solid} {name}\n")
}

fn stls() -> Vec<Vec<u8>> {
    let one = text_of_stl("a thing", ["endloop", "endfacet", "endsolid"]);
    let two = text_of_stl("", ["end loop", "End Facet", "end solid"]);
    let mut binary = vec![b' '; 80];
    binary.extend(20u32.to_le_bytes());
    for corners in icosphere(0).triangles() {
        let floats = [0.0; 3].into_iter().chain(corners.into_iter().flatten());
        binary.extend(floats.flat_map(|x| (x as f32).to_le_bytes()));
        binary.extend([0, 0]);
    }
    vec![one.clone().into_bytes(), two.clone().into_bytes(), (one + &two).into_bytes(), binary]
}

fn plys() -> Vec<Vec<u8>> {
    let text = "ply\nformat ascii 1.0\ncomment made by hand\nobj_info a\nMade by hand\nelement face 2\nproperty list uchar float uv\n\
        property list uint8 uint vertex_index\nproperty int flags\nelement edge 1\nproperty int a\nelement vertex 4\n\
        property double nx\nproperty double z\nproperty double y\nproperty double x\nproperty float red\nproperty float green\nproperty float blue\n\
        end_header\n2 .5 .5 3 0 1 2 9\n0 4 0 1 2 3 9 7 7\n4\n0 3 2 1 0 .5 1\n0 6 5 4 1 1 1\n0 9 9 1e-3 0 0 0\n0 1 9 1 0 0 0 4\n";
    let big: Vec<u8> = {
        let head = "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let floats = [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].into_iter().flat_map(f32::to_be_bytes);
        let face = [3u8].into_iter().chain([0i32, 1, 2].into_iter().flat_map(i32::to_be_bytes));
        head.bytes().chain(floats).chain(face).collect()
    };
    let sphere = icosphere(0);
    let colours = sphere.positions().iter().map(|p| p.map(f64::abs)).collect();
    let painted = sphere.with_colours(colours).expect("as many colours");
    vec![text.into(), big, painted.to_ply(), icosphere(1).to_ply()]
}

/// A ball with the x and y of every vertex as its texture coordinate.
fn textured() -> Mesh {
    let mesh = icosphere(0);
    let coordinates = mesh.positions().iter().map(|&[x, y, _]| [x, y]).collect();
    let texture = Texture::new(coordinates, mesh.faces().to_vec()).expect("valid");
    let texture = texture.with_picture(b"\x89PNG\r\n\x1a\n".to_vec()).expect("a picture");
    mesh.with_texture(texture).expect("as many faces")
}

fn glbs() -> Vec<Vec<u8>> {
    let sphere = icosphere(0);
    let colours = sphere.positions().iter().map(|p| p.map(f64::abs)).collect();
    let painted = sphere.with_colours(colours).expect("as many colours");
    vec![textured().to_glb(), painted.to_glb(), icosphere(1).to_glb()]
}

/// A GLB file with this JSON.
fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let word = |length: usize| (length as u32).to_le_bytes();
    let mut file = b"glTF".to_vec();
    file.extend([word(2), word(28 + json.len() + bin.len()), word(json.len())].concat());
    file.extend([b"JSON", json, &word(bin.len()), b"BIN\0", bin].concat());
    file
}

/// Positions, coordinates, indices, colours and a picture.
fn bin() -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut bin = floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    bin.extend(floats(&[0.0, 0.75, 0.5, 0.75, 0.5, 0.0, 0.0, 0.0]));
    bin.extend([0, 1, 2, 0, 2, 3, 0, 0]);
    bin.extend([0, 255, 51, 255].repeat(4));
    bin.extend(b"\x89PNG\r\n\x1a\n");
    bin
}

fn offs() -> Vec<Vec<u8>> {
    let plain =
        "OFF\n# made by hand\n4 2 0\n0 0 0\n1 0 0\n1 1 .5\n0 1 0\n3 0 1 2\n4 0 1 2 3 1 0 0\n";
    let joined = "OFF4 1 5\n0 0 0\n1 0 0\n1 1 1e0\n0 1 0\n4 3 2 1 0";
    let coloured =
        "CNOFF 3 1 0\n0 0 0 0 0 1 255 0 0 255\n1 0 0 0 0 1 0 .5 0 1\n0 1 0 0 0 1 0 0 7\n3 0 1 2\n";
    vec![plain.into(), joined.into(), coloured.into()]
}

/// Files whose buffer is in another file.
fn gltf_files() -> Vec<Vec<u8>> {
    let beside = |json: Vec<u8>| {
        let mut json: Value = serde_json::from_slice(&json).expect("JSON");
        json["buffers"] = json!([{"byteLength": 112, "uri": "a%20b.bin"}, {"uri": "a.png"}]);
        json.to_string().into_bytes()
    };
    jsons().into_iter().map(beside).collect()
}

fn gltf_file(bytes: &[u8], folder: &Path) {
    beside(folder);
    if !folder.join("a b.bin").exists() {
        fs::write(folder.join("a b.bin"), bin()).expect("a file in the folder");
    }
    loaded(bytes, folder, "a.gltf");
}

fn jsons() -> Vec<Vec<u8>> {
    let part = |indices: u32| {
        let attributes = json!({"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 4});
        json!({"attributes": attributes, "indices": indices, "material": 0})
    };
    let plain = json!({
        "asset": {"version": "2.0"},
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "children": [1], "scale": [-1, 1, 2]}, {"mesh": 0, "rotation": [0, 0, 1, 0]}],
        "meshes": [{"primitives": [part(2), part(3)]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 4, "mimeType": "image/png"}, {"uri": "a.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5121, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "byteOffset": 3, "componentType": 5121, "count": 3, "type": "SCALAR"},
            {"bufferView": 3, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 6},
            {"buffer": 0, "byteOffset": 88, "byteLength": 16},
            {"buffer": 0, "byteOffset": 104, "byteLength": 8, "byteStride": 16},
        ],
        "buffers": [{"byteLength": 112}],
    });
    let mut glossy = plain.clone();
    let name = "KHR_materials_pbrSpecularGlossiness";
    glossy["extensionsRequired"] = json!([name]);
    glossy["materials"] = json!([{"extensions": {name: {"diffuseTexture": {"index": 0}}}}]);
    glossy["images"] = json!([{"uri": "data:image/png;base64,iVBORw0KGgo="}]);
    let mut own = plain.clone();
    own["buffers"] =
        json!([{"byteLength": 112, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAA"}]);
    own["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": 0}}]}]);
    own["accessors"] =
        json!([{"bufferView": 0, "componentType": 5120, "count": 6, "type": "VEC3"}]);
    own["bufferViews"] = json!([{"buffer": 0, "byteLength": 24, "byteStride": 4}]);
    let mut sparse = plain.clone();
    sparse["accessors"][0]["sparse"] = json!({
        "count": 1,
        "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 0},
    });
    let lists: [Value; 4] = [plain, glossy, own, sparse];
    lists.iter().map(|json| json.to_string().into_bytes()).collect()
}
