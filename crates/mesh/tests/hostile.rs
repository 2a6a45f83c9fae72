//! For any bytes, reading returns a valid mesh or an error of one line.

use std::fs;

use proptest::{collection::vec, prelude::*, sample};
use softrast_mesh::{Mesh, Texture, icosphere};

/// Reads `bytes` and checks the guarantees of every mesh.
fn read(bytes: &[u8], name: &str) {
    match Mesh::parse(bytes, name) {
        Ok(mesh) => {
            let again = Mesh::new(mesh.positions().to_vec(), mesh.faces().to_vec());
            let again = again.expect("a valid mesh");
            if let Some(colours) = mesh.colours() {
                again.with_colours(colours.to_vec()).expect("valid colours");
            }
            let normalized = mesh.normalized();
            assert!(normalized.positions().iter().flatten().all(|x| x.abs() <= 1.0));
            assert!(mesh.area().is_finite());
        }
        Err(error) => {
            let message = error.to_string();
            let one_line = !message.contains(char::is_control);
            assert!(message.starts_with(&format!("{name}:")) && one_line, "{message:?}");
        }
    }
}

/// Reads `bytes` from a file, with textures, and checks the guarantees of every mesh.
fn read_textured(bytes: &[u8], name: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("a file");
    let Ok((mesh, warnings)) = Mesh::load_textured(&path) else { return };
    let messages: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    assert!(messages.iter().all(|text| !text.contains(char::is_control)), "{messages:?}");
    if let Some(texture) = mesh.texture() {
        Texture::new(texture.coordinates().to_vec(), texture.corners().to_vec()).expect("valid");
        assert_eq!(texture.corners().len(), mesh.faces().len());
    }
    let plain = Mesh::load(&path).expect("the same mesh");
    assert_eq!((plain.positions(), plain.faces()), (mesh.positions(), mesh.faces()));
}

fn nasty_files() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/nasty");
    let entries = fs::read_dir(folder).expect("the folder of nasty files");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("a nasty file")).collect()
}

/// Pieces of OBJ files in any order: far more often nearly valid than random bytes.
fn pieces() -> impl Strategy<Value = Vec<u8>> {
    let piece = sample::select(vec![
        "v",
        "f",
        "l",
        "o a",
        "#",
        "\\",
        "/",
        "//",
        " ",
        " ",
        " ",
        "\n",
        "\n",
        "\r",
        "\t",
        "0",
        "1",
        "2",
        "3",
        "-1",
        "-2",
        "4e38",
        "1e-42",
        ".5",
        "nan",
        "\nv 1 2 3\n",
        "\nv 3 -1 2\n",
        "\nv 0 0 1\n",
        "\nv 0 0 1 1 0 .5\n",
        "\nf 1 2 3\n",
        "\nvt 0 1\n",
        "\nf 1/1 2/1 3/-1\n",
        "\nmtllib /dev/zero\n",
        "\nf -1 -2 -3\n",
        "\u{feff}",
        "\u{85}",
        "\u{2028}",
    ]);
    vec(piece, 0..60).prop_map(|pieces| pieces.concat().into_bytes())
}

/// The mesh with the x and y of every vertex as its texture coordinate.
fn textured(mesh: Mesh) -> Mesh {
    let coordinates = mesh.positions().iter().map(|&[x, y, _]| [x, y]).collect();
    let texture = Texture::new(coordinates, mesh.faces().to_vec()).expect("valid");
    let texture = texture.with_picture(b"\x89PNG\r\n\x1a\n".to_vec()).expect("a picture");
    mesh.with_texture(texture).expect("as many faces")
}

fn text_of_ply(mesh: &Mesh) -> Vec<u8> {
    let plain = Mesh::new(mesh.positions().to_vec(), mesh.faces().to_vec()).expect("a valid mesh");
    let rows = plain.to_obj().replace("v ", "");
    let (vertices, _) = rows.split_once('f').expect("faces");
    let faces: String = mesh.faces().iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect();
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
        element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.positions().len(),
        mesh.faces().len()
    );
    (header + vertices + &faces).into_bytes()
}

fn text_of_stl(mesh: &Mesh) -> Vec<u8> {
    let facets = mesh.triangles().map(|corners| {
        let vertices = corners.map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).concat();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    });
    format!("solid\n{}endsolid\n", facets.collect::<String>()).into_bytes()
}

#[test]
fn the_ending_names_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let message = |name: &str| Mesh::parse(b"", name).unwrap_err().to_string();
    let read = "meshes are read from files that end in .obj, .ply, .stl, .off, .glb or .gltf";
    assert_eq!(message("a.fbx"), format!("a.fbx: {read}"));
    let path = folder.path().join("a.stl");
    let error = icosphere(0).save(&path).unwrap_err().to_string();
    assert!(error.ends_with("a.stl: meshes are written to files that end in .obj, .ply or .glb"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(2000))]

    #[test]
    fn random_bytes_never_break_the_reader(bytes in vec(any::<u8>(), 0..400)) {
        read(&bytes, "a.obj");
    }

    #[test]
    fn random_pieces_never_break_the_reader(bytes in pieces()) {
        read(&bytes, "a.obj");
        read_textured(&bytes, "a.obj");
    }

    #[test]
    fn changed_files_never_break_the_reader(
        mut bytes in sample::select(nasty_files()),
        changes in vec((any::<sample::Index>(), any::<u8>(), 0..4), 0..8),
    ) {
        for (place, byte, kind) in changes {
            if !bytes.is_empty() {
                let place = place.index(bytes.len());
                match kind {
                    0 => bytes[place] = byte,
                    1 => bytes[place] = b"0123456789-. \n\\/vf"[usize::from(byte) % 18],
                    2 => bytes.insert(place, byte),
                    _ => bytes.truncate(place),
                }
            }
        }
        read(&bytes, "a.obj");
    }

    #[test]
    fn changed_ply_stl_and_glb_files_never_break_the_reader(
        format in 0..4usize,
        changes in vec((any::<sample::Index>(), any::<u8>(), 0..4), 1..6),
    ) {
        let sphere = icosphere(0);
        let colours = sphere.positions().iter().map(|p| p.map(f64::abs)).collect();
        let sphere = if changes.len() % 2 == 0 { sphere.with_colours(colours).unwrap() } else { sphere };
        let sphere = if changes.len() % 3 == 0 { textured(sphere) } else { sphere };
        let (name, mut bytes) = match format {
            0 => ("a.ply", sphere.to_ply()),
            1 => ("a.ply", text_of_ply(&sphere)),
            2 => ("a.glb", sphere.to_glb()),
            _ => ("a.stl", text_of_stl(&sphere)),
        };
        read(&bytes, name);
        for (place, byte, kind) in changes {
            if !bytes.is_empty() {
                // Half of the changes are in the header, where most is determined.
                let length = if byte % 2 == 0 { bytes.len() } else { bytes.len().min(300) };
                let place = place.index(length);
                match kind {
                    0 => bytes[place] = byte,
                    1 => bytes[place] = b"0123456789-. \n[]{}\","[usize::from(byte) % 20],
                    2 => bytes.insert(place, byte),
                    _ => bytes.truncate(place),
                }
            }
        }
        read(&bytes, name);
        read_textured(&bytes, name);
    }

    #[test]
    fn what_is_written_is_read_back(
        positions in vec([-1e38..1e38f64, -1e-3..1e-3, -1e3..1e3], 1..9),
        corners in vec(any::<[sample::Index; 3]>(), 1..9),
    ) {
        let count = positions.len();
        let faces = corners.iter().map(|face| face.map(|corner| corner.index(count) as u32)).collect();
        let mesh = Mesh::new(positions, faces).unwrap();
        prop_assert_eq!(&Mesh::parse(mesh.to_obj().as_bytes(), "a.obj").unwrap(), &mesh);
        prop_assert_eq!(&Mesh::parse(&mesh.to_ply(), "a.ply").unwrap(), &mesh);
        let glb = Mesh::parse(&mesh.to_glb(), "a.glb").unwrap();
        let origin = mesh.glb_origin();
        let rounded = mesh.positions().iter().map(|p| {
            [0, 1, 2].map(|k| origin[k] + f64::from((p[k] - origin[k]) as f32))
        });
        prop_assert_eq!(glb.positions(), rounded.collect::<Vec<_>>());
        prop_assert_eq!(glb.faces(), mesh.faces());
    }

    #[test]
    fn colours_that_are_written_are_read_back(
        colours in vec(any::<[u16; 3]>(), 1..9),
        corners in vec(any::<[sample::Index; 3]>(), 1..9),
    ) {
        let count = colours.len();
        let faces = corners.iter().map(|face| face.map(|corner| corner.index(count) as u32)).collect();
        let colours = colours.iter().map(|c| c.map(|x| f64::from(x) / f64::from(u16::MAX)));
        let mesh = Mesh::new(vec![[1.0; 3]; count], faces).unwrap();
        let mesh = mesh.with_colours(colours.collect()).unwrap();
        prop_assert_eq!(&Mesh::parse(mesh.to_obj().as_bytes(), "a.obj").unwrap(), &mesh);
        let close = |file: &[u8], name: &str, tolerance: f64| {
            let found = Mesh::parse(file, name).unwrap();
            let of = |mesh: &Mesh| mesh.colours().unwrap().concat();
            let off = of(&found).into_iter().zip(of(&mesh)).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max);
            assert!(off < tolerance && found.faces() == mesh.faces(), "{name}: off by {off}");
        };
        close(&mesh.to_ply(), "a.ply", 0.5 / 255.0 + 1e-9);
        close(&mesh.to_glb(), "a.glb", 1e-6);
    }

    #[test]
    fn normalizing_centres_the_box_and_makes_its_longest_side_two(
        scale in -30.0..30.0f64,
        stretch in [0.01..1.0f64, 0.01..1.0, 0.01..1.0],
        offset in [-1e3..1e3f64, -1e3..1e3, -1e3..1e3],
    ) {
        let sphere = icosphere(1);
        let size = 10f64.powf(scale);
        let place = |p: &[f64; 3]| [0, 1, 2].map(|k| size * (stretch[k] * p[k] + offset[k]));
        let moved = sphere.positions().iter().map(place).collect();
        let mesh = Mesh::new(moved, sphere.faces().to_vec()).unwrap().normalized();
        let [low, high] = mesh.bounds();
        // Rounding an offset of 1e3 moves a stretch of 0.01 by 1e-11 of its size.
        prop_assert!((0..3).all(|k| (low[k] + high[k]).abs() < 1e-10));
        prop_assert_eq!((0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max), 2.0);
        let again = mesh.normalized();
        let pairs = again.positions().iter().flatten().zip(mesh.positions().iter().flatten());
        prop_assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-10));
    }
}
