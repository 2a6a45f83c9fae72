//! Whatever the bytes, reading gives a valid mesh or an error of one line, and nothing else.

use std::fs;

use proptest::{collection::vec, prelude::*, sample};
use softrast_mesh::{Mesh, icosphere};

/// Reads `bytes` and checks what every mesh promises.
fn read(bytes: &[u8]) {
    match Mesh::parse(bytes, "a.obj") {
        Ok(mesh) => {
            Mesh::new(mesh.positions().to_vec(), mesh.faces().to_vec()).expect("a valid mesh");
            let normalized = mesh.normalized();
            assert!(normalized.positions().iter().flatten().all(|x| x.abs() <= 1.0));
            assert!(mesh.area().is_finite());
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("a.obj:") && message.lines().count() == 1, "{message:?}");
        }
    }
}

fn nasty_files() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/nasty");
    let entries = fs::read_dir(folder).expect("the folder of nasty files");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("a nasty file")).collect()
}

/// Pieces of OBJ files in any order: far more often nearly valid than random bytes are.
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
        "\nf 1 2 3\n",
        "\nf -1 -2 -3\n",
        "\u{feff}",
        "\u{85}",
        "\u{2028}",
    ]);
    vec(piece, 0..60).prop_map(|pieces| pieces.concat().into_bytes())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_bytes_never_break_the_reader(bytes in vec(any::<u8>(), 0..400)) {
        read(&bytes);
    }

    #[test]
    fn random_pieces_never_break_the_reader(bytes in pieces()) {
        read(&bytes);
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
        read(&bytes);
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
