//! GLB files as programs write them, and invalid ones.

use serde_json::{Value, json};
use softrast_mesh::Mesh;

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    let word = |length: usize| (length as u32).to_le_bytes();
    file.extend([word(2), word(28 + json.len() + bin.len()), word(json.len())].concat());
    file.extend([b"JSON", json.as_slice(), &word(bin.len()), b"BIN\0", bin].concat());
    file
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// One mesh: four corners of a square at z = 0 to 3, twelve bytes each, then `indices`.
fn square(indices: &[u8], component: u32, count: usize, mode: u32) -> (Value, Vec<u8>) {
    let corners = [0., 0., 0., 1., 0., 1., 1., 1., 2., 0., 1., 3.];
    let json = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": component, "count": count, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": indices.len()},
        ],
        "buffers": [{"byteLength": 48 + indices.len()}],
    });
    (json, [floats(&corners).as_slice(), indices].concat())
}

fn bytes() -> (Value, Vec<u8>) {
    square(&[0, 1, 2, 0, 2, 3], 5121, 6, 4)
}

fn faces((json, bin): (Value, Vec<u8>)) -> Vec<[u32; 3]> {
    Mesh::parse(&glb(&json, &bin), "a.glb").expect("a sound file").faces().to_vec()
}

#[test]
fn indices_have_8_16_or_32_bits_or_are_left_out() {
    let two = [[0, 1, 2], [0, 2, 3]];
    assert_eq!(faces(bytes()), two);
    let short: Vec<u8> = [0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    assert_eq!(faces(square(&short, 5123, 6, 4)), two);
    let long: Vec<u8> = [0u32, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    assert_eq!(faces(square(&long, 5125, 6, 4)), two);
    let (mut json, bin) = bytes();
    json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    json["accessors"][0]["count"] = json!(3);
    assert_eq!(faces((json, bin)), [[0, 1, 2]]);
}

#[test]
fn strips_and_fans_are_triangles_of_one_side() {
    assert_eq!(faces(square(&[0, 1, 3, 2], 5121, 4, 5)), [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(faces(square(&[0, 1, 2, 3], 5121, 4, 6)), [[0, 1, 2], [0, 2, 3]]);
    // Lines have no surface.
    let (json, bin) = square(&[0, 1, 2, 3], 5121, 4, 1);
    let error = Mesh::parse(&glb(&json, &bin), "a.glb").unwrap_err().to_string();
    assert!(error.starts_with("a.glb: no faces: "), "{error}");
}

#[test]
fn nodes_place_meshes_and_mirrors_keep_their_outside() {
    let (mut json, bin) = bytes();
    json["scenes"][0]["nodes"] = json!([1, 2]);
    json["nodes"] = json!([
        {"mesh": 0, "translation": [0, 0, 1]},
        {"children": [0], "scale": [2, 1, 1], "translation": [5, 0, 0]},
        {"mesh": 0, "scale": [-1, 1, 1]},
    ]);
    let mesh = Mesh::parse(&glb(&json, &bin), "a.glb").unwrap();
    assert_eq!(mesh.positions()[1], [7.0, 0.0, 2.0]);
    assert_eq!(mesh.positions()[5], [-1.0, 0.0, 1.0]);
    assert_eq!(mesh.faces(), [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]);
}

#[test]
fn parts_share_vertices_that_lie_between_other_data() {
    let (mut json, bin) = bytes();
    json["bufferViews"][0]["byteStride"] = json!(16);
    json["bufferViews"][0]["byteLength"] = json!(64);
    json["bufferViews"][1]["byteOffset"] = json!(64);
    let spread: Vec<u8> = bin[..48].chunks(12).flat_map(|p| [p, &[255; 4]].concat()).collect();
    let primitive = json["meshes"][0]["primitives"][0].clone();
    json["meshes"][0]["primitives"] = json!([primitive, primitive]);
    let mesh = Mesh::parse(&glb(&json, &[&spread, &bin[48..]].concat()), "a.glb").unwrap();
    assert_eq!(mesh.positions()[3], [0.0, 1.0, 3.0]);
    assert_eq!((mesh.positions().len(), mesh.faces().len()), (4, 4));
}

#[test]
fn quantised_and_sparse_positions_are_read() {
    let (mut json, bin) = bytes();
    json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    json["accessors"][0] = json!({
        "bufferView": 2, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3",
        "sparse": {
            "count": 1,
            "indices": {"bufferView": 3, "componentType": 5121},
            "values": {"bufferView": 4},
        },
    });
    json["bufferViews"].as_array_mut().unwrap().extend([
        json!({"buffer": 0, "byteOffset": 56, "byteLength": 16, "byteStride": 4}),
        json!({"buffer": 0, "byteOffset": 72, "byteLength": 1}),
        json!({"buffer": 0, "byteOffset": 76, "byteLength": 3}),
    ]);
    let mut bin = [bin, vec![0; 2]].concat();
    bin.extend([0, 0, 0, 9, 127, 0, 0, 9, 127, 127, 0, 9, 0, 127, 0, 9]);
    bin.extend([2, 0, 0, 0, 129, 127, 127]);
    let mesh = Mesh::parse(&glb(&json, &bin), "a.glb").unwrap();
    assert_eq!(mesh.positions(), [[0., 0., 0.], [1., 0., 0.], [-1., 1., 1.], [0., 1., 0.]]);
}

/// The square with colours at its vertices: their component type, shape and bytes.
fn coloured(component: u32, shape: &str, colours: &[u8]) -> (Value, Vec<u8>) {
    let (mut json, bin) = bytes();
    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = json!(2);
    json["accessors"].as_array_mut().expect("a list").push(json!({
        "bufferView": 2, "componentType": component, "normalized": component != 5126, "count": 4, "type": shape,
    }));
    json["bufferViews"].as_array_mut().expect("a list").push(json!({
        "buffer": 0, "byteOffset": 56, "byteLength": colours.len(),
    }));
    (json, [bin.as_slice(), &[0; 2], colours].concat())
}

fn colours((json, bin): &(Value, Vec<u8>)) -> Option<Vec<[f64; 3]>> {
    let mesh = Mesh::parse(&glb(json, bin), "a.glb").expect("a sound file");
    mesh.colours().map(<[_]>::to_vec)
}

#[test]
fn colours_are_floats_bytes_or_shorts_and_linear() {
    // A fifth of the light is almost a half in sRGB.
    let fifth = 0.484_529_204_481_713;
    let expected = [[0.0, 1.0, fifth]; 4];
    let close = |found: &(Value, Vec<u8>), expected: &[[f64; 3]]| {
        let found = colours(found).unwrap();
        let mut pairs = found.as_flattened().iter().zip(expected.as_flattened());
        assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
    };
    close(&coloured(5121, "VEC3", &[0, 255, 51].repeat(4)), &expected);
    close(&coloured(5121, "VEC4", &[0, 255, 51, 7].repeat(4)), &expected);
    let shorts: Vec<u8> = [0u16, 65535, 13107].iter().flat_map(|x| x.to_le_bytes()).collect();
    close(&coloured(5123, "VEC3", &shorts.repeat(4)), &expected);
    // Values beyond 0 and 1 are clamped, as the format requires.
    close(&coloured(5126, "VEC3", &floats(&[-1.0, 9.0, 0.2]).repeat(4)), &expected);
    // Near 0 the curve is a straight line.
    close(&coloured(5126, "VEC4", &floats(&[0.002; 16])), &[[0.02584; 3]; 4]);
}

#[test]
fn parts_without_colours_are_white_beside_others() {
    let (mut json, bin) = coloured(5121, "VEC3", &[0, 255, 0].repeat(4));
    let painted = json["meshes"][0]["primitives"][0].clone();
    let plain = json!({"attributes": {"POSITION": 0}, "indices": 1});
    json["meshes"][0]["primitives"] = json!([plain, painted, plain]);
    let white = [[1.0; 3]; 4];
    let green = [[0.0, 1.0, 0.0]; 4];
    let found = colours(&(json.clone(), bin.clone())).unwrap();
    assert_eq!(found, [white, green].concat(), "both plain parts share their vertices");
    json["meshes"][0]["primitives"] = json!([painted, plain]);
    assert_eq!(colours(&(json.clone(), bin.clone())).unwrap(), [green, white].concat());
    json["meshes"][0]["primitives"] = json!([plain]);
    assert_eq!(colours(&(json, bin)), None);
}

/// The colours of a file and its warnings.
fn warned((json, bin): &(Value, Vec<u8>)) -> (Option<Vec<[f64; 3]>>, Vec<String>) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.glb");
    std::fs::write(&path, glb(json, bin)).expect("a file");
    let (mesh, warnings) = Mesh::load_textured(&path).expect("a sound file");
    let name = path.display().to_string();
    let short = |warning: &softrast_mesh::MeshError| warning.to_string().replace(&name, "a.glb");
    (mesh.colours().map(<[_]>::to_vec), warnings.iter().map(short).collect())
}

#[test]
fn colours_that_cannot_be_used_are_left_out_with_one_warning() {
    let place = "a.glb: mesh 0, primitive 0";
    let sound = || coloured(5121, "VEC3", &[0; 12]);
    let (mut few, mut none, mut twice) =
        (sound(), sound(), coloured(5126, "VEC3", &floats(&[f32::NAN; 12])));
    few.0["accessors"][2]["count"] = json!(3);
    none.0["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!("red");
    twice.0["nodes"] = json!([{"mesh": 0}, {"mesh": 0}]);
    twice.0["scenes"][0]["nodes"] = json!([0, 1]);
    let nan = ", vertex 0: colour NaN is not from 0 to 1: the colours are left out";
    let beyond =
        ", accessor 2: 4 entries reach beyond buffer 0 or buffer view 2: the colours are left out";
    let cases = [
        (coloured(5126, "VEC3", &floats(&[f32::NAN; 12])), nan),
        (twice, nan),
        (
            coloured(5121, "VEC2", &[0; 12]),
            ", accessor 2: colours are of type VEC3 or VEC4, not \"VEC2\": the colours are left out",
        ),
        (
            coloured(5122, "VEC3", &[0; 24]),
            ", accessor 2: colours are floats, or bytes or shorts without a sign: the colours are left out",
        ),
        (few, ": 3 colours for 4 vertices: the colours are left out"),
        (none, ": COLOR_0 is no accessor: \"red\": the colours are left out"),
        (coloured(5126, "VEC3", &[0; 12]), beyond),
    ];
    for (file, message) in cases {
        assert_eq!(warned(&file), (None, vec![format!("{place}{message}")]));
    }
}

#[test]
fn colours_of_other_scales_are_scaled_or_clamped_with_one_warning() {
    let fifth = 0.484_529_204_481_713;
    let close = |file: &(Value, Vec<u8>), expected: [f64; 3], message: &str| {
        let (colours, warnings) = warned(file);
        let colours = colours.expect(message);
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6;
        assert!(colours.iter().all(|colour| colour.iter().zip(&expected).all(near)), "{colours:?}");
        assert_eq!(warnings, [format!("a.glb: mesh 0, primitive 0, {message}")]);
    };
    let unsaid = |(mut json, bin): (Value, Vec<u8>)| {
        json["accessors"][2]["normalized"] = json!(false);
        (json, bin)
    };
    let bytes = unsaid(coloured(5121, "VEC4", &[0, 255, 51, 255].repeat(4)));
    let message = "accessor 2: colours are not normalized: they are taken as 0 to 255";
    close(&bytes, [0.0, 1.0, fifth], message);
    let shorts: Vec<u8> = [0u16, 65535, 13107].iter().flat_map(|x| x.to_le_bytes()).collect();
    let shorts = unsaid(coloured(5123, "VEC3", &shorts.repeat(4)));
    let message = "accessor 2: colours are not normalized: they are taken as 0 to 65535";
    close(&shorts, [0.0, 1.0, fifth], message);
    let levels = coloured(5126, "VEC3", &floats(&[0.0, 255.0, 51.0]).repeat(4));
    let message =
        "vertex 0: colour 255 is not from 0 to 1: all colours are taken as levels from 0 to 255";
    close(&levels, [0.0, 1.0, fifth], message);
    let bright = coloured(5126, "VEC3", &floats(&[-1.0, 9.0, 0.2]).repeat(4));
    let message = "vertex 0: colour -1 is not from 0 to 1: it is clamped, and so are others";
    close(&bright, [0.0, 1.0, fifth], message);
}

#[test]
fn buffers_may_be_data_uris_with_or_without_a_binary_chunk() {
    use base64::{
        Engine,
        engine::general_purpose::{STANDARD, STANDARD_NO_PAD},
    };
    let expected = [[0, 1, 2], [0, 2, 3]];
    let (json, bin) = bytes();
    for coded in [STANDARD.encode(&bin), STANDARD_NO_PAD.encode(&bin)] {
        for head in ["data:application/octet-stream", "data:application/gltf-buffer", "data:"] {
            let mut json = json.clone();
            json["buffers"][0]["uri"] = json!(format!("{head};base64,{coded}"));
            assert_eq!(faces((json.clone(), vec![])), expected);
            // Without the header of an empty binary chunk.
            let whole = glb(&json, &[]);
            let mut file = whole[..whole.len() - 8].to_vec();
            let length = (file.len() as u32).to_le_bytes();
            file[8..12].copy_from_slice(&length);
            assert_eq!(Mesh::parse(&file, "a.glb").expect("a sound file").faces(), expected);
            // A second buffer next to the binary chunk.
            json["buffers"] = json!([{"byteLength": 6}, json["buffers"][0]]);
            json["bufferViews"][0]["buffer"] = json!(1);
            json["bufferViews"][1] = json!({"buffer": 0, "byteLength": 6});
            assert_eq!(faces((json, bin[48..].to_vec())), expected);
        }
    }
    let mut broken = json;
    broken["buffers"][0]["uri"] = json!("data:;base64,?");
    let error = Mesh::parse(&glb(&broken, &bin), "a.glb").expect_err("not base64").to_string();
    let place = "a.glb: node 0, mesh 0, primitive 0, accessor 0";
    assert_eq!(error, format!("{place}: buffer 0 is a data URI that is not base64"));
}

#[test]
fn factors_of_materials_multiply_the_linear_colours_of_their_parts() {
    let (mut json, bin) = coloured(5121, "VEC4", &[0, 255, 255, 255].repeat(4));
    let material = |factor: Value| json!({"pbrMetallicRoughness": {"baseColorFactor": factor}});
    json["materials"] = json!([
        material(json!([0.5, 1.0, 0.0, 1.0])),
        material(json!([0.5, 2.0, 0.0, 1.0])),
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 0.5, 1, 1]}}},
    ]);
    let part = json["meshes"][0]["primitives"][0].clone();
    let with = |material: usize, coloured: bool| {
        let mut part = part.clone();
        part["material"] = json!(material);
        if !coloured {
            part["attributes"].as_object_mut().unwrap().remove("COLOR_0");
        }
        part
    };
    // Half of the light in sRGB.
    let half = 0.735_356_983_052_449_2;
    for (parts, expected) in [
        (vec![with(0, true)], vec![[0.0, 1.0, 0.0]]),
        (vec![with(0, false)], vec![[half, 1.0, 0.0]]),
        // A value that is not a factor counts as 1.
        (vec![with(1, true)], vec![[0.0, 1.0, 1.0]]),
        (vec![with(2, false)], vec![[0.0, half, 1.0]]),
        // Vertices shared by two factors have none; those with separate colours are different vertices.
        (vec![with(2, false), with(0, false), with(0, true)], vec![[1.0; 3], [0.0, 1.0, 0.0]]),
    ] {
        json["meshes"][0]["primitives"] = json!(parts);
        let mesh = Mesh::parse(&glb(&json, &bin), "a.glb").unwrap();
        let colours = mesh.colours().unwrap();
        assert_eq!(colours.len(), 4 * expected.len());
        for (colours, expected) in colours.chunks(4).zip(expected) {
            for (found, wanted) in colours.as_flattened().iter().zip(expected.iter().cycle()) {
                assert!((found - wanted).abs() < 1e-12, "{colours:?}");
            }
        }
    }
}

#[test]
fn a_gltf_file_has_its_buffers_inside_or_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (mut json, bin) = bytes();
    let expected = [[0, 1, 2], [0, 2, 3]];
    std::fs::write(at("my buffer.bin"), &bin).unwrap();
    let whole = Mesh::parse(&glb(&json, &bin), "a.glb").unwrap();
    for uri in ["my%20buffer.bin", "my buffer.bin", "./my buffer.bin", "../far/my%20buffer.bin"] {
        json["buffers"][0]["uri"] = json!(uri);
        // Some programs write a byte order mark.
        std::fs::write(at("a.gltf"), format!("\u{feff}{json}")).unwrap();
        let mesh = Mesh::load(at("a.gltf")).unwrap();
        assert_eq!((mesh.faces(), mesh.positions()), (&expected[..], whole.positions()), "{uri}");
        assert_eq!(Mesh::load_textured(at("a.gltf")).unwrap().0.faces(), expected);
        std::fs::write(at("a.glb"), glb(&json, &[])).unwrap();
        assert_eq!(Mesh::load(at("a.glb")).unwrap().faces(), expected);
    }
    let message = |file: &str| Mesh::parse(file.as_bytes(), "a.gltf").unwrap_err().to_string();
    let place = "node 0, mesh 0, primitive 0, accessor 0";
    let alone =
        format!("a.gltf: {place}: buffer 0 lies in another file: export it as one .glb file");
    assert_eq!(message(&json.to_string()), alone);
    assert_eq!(message("glTF"), "a.gltf: header: it is a GLB file: let its name end in .glb");
    for (uri, start) in [("none.bin", "none.bin, which cannot be read: "), (".", "")] {
        json["buffers"][0]["uri"] = json!(uri);
        std::fs::write(at("a.gltf"), json.to_string()).unwrap();
        let message = Mesh::load(at("a.gltf")).unwrap_err().to_string();
        assert!(message.contains(&format!("{place}: buffer 0 lies in ")), "{message}");
        assert!(message.contains(start) && message.lines().count() == 1, "{message}");
    }
}

/// Many buffers may refer to one file, and then claim as many zeros as the file has bytes, and no more.
#[test]
fn buffers_that_share_a_file_take_its_bytes_once() {
    let folder = tempfile::tempdir().unwrap();
    let (mut json, bin) = bytes();
    std::fs::write(folder.path().join("a.bin"), &bin).unwrap();
    json["buffers"] = (0..1000).map(|_| json!({"uri": "a.bin"})).collect();
    json["accessors"][0] = json!({
        "componentType": 5126, "count": 40_000, "type": "VEC3",
        "sparse": {"count": 0, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}},
    });
    std::fs::write(folder.path().join("a.gltf"), json.to_string()).unwrap();
    let message = Mesh::load(folder.path().join("a.gltf")).unwrap_err().to_string();
    assert!(message.contains("40000 entries, but no bytes for them"), "{message}");
}

#[test]
fn more_sparse_entries_than_entries_are_one_line() {
    let (mut json, bin) = bytes();
    json["accessors"][0]["sparse"] = json!({
        "count": 5,
        "indices": {"bufferView": 1, "componentType": 5121},
        "values": {"bufferView": 0},
    });
    let error = Mesh::parse(&glb(&json, &bin), "a.glb").expect_err("five of four").to_string();
    assert!(error.ends_with("accessor 0: 5 sparse entries of 4"), "{error}");
}

#[test]
fn bad_files_are_one_line_that_names_the_place() {
    let with = |change: fn(&mut Value)| {
        let (mut json, bin) = bytes();
        change(&mut json);
        glb(&json, &bin)
    };
    let whole = with(|_| ());
    let mut of_version_1 = whole.clone();
    of_version_1[4] = 1;
    let mut huge_chunk = whole.clone();
    huge_chunk[12..16].fill(255);
    let cases: [(Vec<u8>, &str); 15] = [
        (b"{}".to_vec(), "header: not a GLB file: it does not start with glTF"),
        (of_version_1, "header: glTF 1 is not read: export it as glTF 2.0"),
        (whole[..9].to_vec(), "header: the file ends before it is complete"),
        (huge_chunk, "chunk 0: the file ends before it is complete"),
        (
            with(|j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
            "JSON: compressed by KHR_draco_mesh_compression: export it without compression",
        ),
        (
            with(|j| j["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"])),
            "JSON: needs the extension EXT_mesh_gpu_instancing, which is not read",
        ),
        (
            with(|j| j["buffers"][0]["uri"] = json!("a.bin")),
            "node 0, mesh 0, primitive 0, accessor 0: buffer 0 lies in another file: export it as one .glb file",
        ),
        (
            with(|j| j["nodes"][0]["children"] = json!([0])),
            "node 0: it is in the tree of nodes more than once",
        ),
        (with(|j| j["nodes"][0]["mesh"] = json!(1)), "node 0, mesh 1: there is none"),
        (with(|j| j["scene"] = json!(3)), "scene 3: there is none"),
        (
            with(|j| j["accessors"][1]["count"] = json!(9)),
            "node 0, mesh 0, primitive 0, accessor 1: 9 entries reach beyond buffer 0 or buffer view 1",
        ),
        (
            with(|j| j["accessors"][1]["count"] = json!(5)),
            "node 0, mesh 0, primitive 0: 5 corners do not make whole triangles",
        ),
        (
            with(|j| j["accessors"][0]["count"] = json!(3)),
            "node 0, mesh 0, primitive 0: index 3 is out of range: the file has 3 vertices",
        ),
        (
            with(|j| j["nodes"][0]["scale"] = json!([1e39, 1, 1])),
            "node 0, mesh 0, primitive 0, vertex 1: coordinate \"1e39\" is not finite in 32-bit floats",
        ),
        (
            with(|j| j["accessors"][1]["componentType"] = json!(5126)),
            "node 0, mesh 0, primitive 0, accessor 1: indices are single whole numbers of 8, 16 or 32 bits without a sign",
        ),
    ];
    for (file, message) in cases {
        let error = Mesh::parse(&file, "a.glb").expect_err(message).to_string();
        assert_eq!(error, format!("a.glb: {message}"));
    }
}
