use std::{fs, sync::OnceLock};

use proptest::prelude::*;
use reconstruct::{NpzFolder, Procedural, Shapes, Split};
use zip::CompressionMethod;

use crate::files::{class, npy, npz, path};

#[test]
fn files_give_back_what_was_written_compressed_or_not() {
    let folder = tempfile::tempdir().unwrap();
    class(folder.path(), "b", 4, Split::Train, CompressionMethod::Stored);
    class(folder.path(), "a", 2, Split::Train, CompressionMethod::Deflated);
    let files = NpzFolder::open(folder.path(), Split::Train).unwrap();
    let made = Procedural::new(Split::Train, 0, 2);
    assert_eq!(files.classes(), ["a", "b"]);
    for (class, of) in [(0, 2), (1, 4)] {
        assert_eq!(files.count(class), 2);
        for shape in 0..2 {
            assert_eq!(files.voxels(class, shape).unwrap(), made.voxels(of, shape).unwrap());
            for view in [0, 13, 23] {
                let [found, expected] = [
                    files.picture(class, shape, view).unwrap(),
                    made.picture(of, shape, view).unwrap(),
                ];
                assert!(found == expected, "class {class}, shape {shape}, view {view}");
            }
        }
    }
}

#[test]
fn what_is_wrong_with_a_file_is_said_in_one_line_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let error = || format!("{:#}", NpzFolder::open(folder, Split::Train).unwrap_err());
    let check = |message: String, parts: &[&str]| {
        assert!(!message.contains('\n'), "{message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    check(error(), &["there is no file named <class>_train_images.npz in"]);

    class(folder, "car", 1, Split::Train, CompressionMethod::Stored);
    let [images, voxels] = ["images", "voxels"].map(|what| path(folder, "car", Split::Train, what));
    let whole = fs::read(&images).unwrap();
    let kept = fs::read(&voxels).unwrap();

    fs::remove_file(&voxels).unwrap();
    check(error(), &["car_train_voxels.npz is missing"]);
    check(
        format!("{:#}", NpzFolder::open(folder, Split::Test).unwrap_err()),
        &["car_test_images.npz is missing"],
    );
    fs::write(&voxels, &kept).unwrap();

    fs::write(&images, &whole[..whole.len() / 2]).unwrap();
    check(
        error(),
        &["cannot use", "car_train_images.npz", "no NPZ file, or is damaged or cut off"],
    );
    fs::write(&images, b"").unwrap();
    check(error(), &["car_train_images.npz", "no NPZ file"]);

    let small = npy("|u1", "2, 24, 3, 64, 64", &vec![0; 2 * 24 * 3 * 64 * 64]);
    npz(&images, &small, CompressionMethod::Stored);
    check(error(), &["its array is (2, 24, 3, 64, 64), expected (shapes, 24, 4, 64, 64)"]);
    npz(&images, &npy("|u1", "0, 24, 4, 64, 64", &[]), CompressionMethod::Stored);
    check(error(), &["car_train_images.npz", "it holds no shape"]);
    let short = npy("|u1", "3, 24, 4, 64, 64", &vec![0; 2 * 24 * 4 * 64 * 64]);
    npz(&images, &short, CompressionMethod::Deflated);
    check(error(), &["car_train_images.npz", "bytes, expected"]);
    let single = npy("|u1", "1, 24, 4, 64, 64", &vec![0; 24 * 4 * 64 * 64]);
    npz(&images, &single, CompressionMethod::Deflated);
    check(error(), &["car_train_images.npz holds 1 shapes, but", "car_train_voxels.npz holds 2"]);

    // A damaged byte of the compressed pictures.
    class(folder, "car", 1, Split::Train, CompressionMethod::Deflated);
    let mut bytes = fs::read(&images).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].fill(0x55);
    fs::write(&images, &bytes).unwrap();
    check(error(), &["cannot use", "car_train_images.npz", "damaged"]);
}

/// The bytes of both files of a class, uncompressed and compressed: made once, because pictures are slow.
fn whole() -> &'static [[Vec<u8>; 2]; 2] {
    static WHOLE: OnceLock<[[Vec<u8>; 2]; 2]> = OnceLock::new();
    WHOLE.get_or_init(|| {
        [CompressionMethod::Stored, CompressionMethod::Deflated].map(|method| {
            let folder = tempfile::tempdir().unwrap();
            class(folder.path(), "car", 1, Split::Test, method);
            WHAT.map(|what| fs::read(path(folder.path(), "car", Split::Test, what)).unwrap())
        })
    })
}

const WHAT: [&str; 2] = ["images", "voxels"];

proptest! {
    #![proptest_config(softrast_test_kit::cases(200))]

    /// Headers are at both ends of a file, so most of the damage is done there.
    #[test]
    fn a_damaged_file_is_read_or_ends_in_one_line_that_names_it(
        compressed: bool, voxels: bool, cut: bool, from_end: bool, at in 0..260_usize, bytes: [u8; 3],
    ) {
        let folder = tempfile::tempdir().unwrap();
        let mut files = whole()[usize::from(compressed)].clone();
        let damaged = &mut files[usize::from(voxels)];
        let at = if from_end { damaged.len() - 3 - at } else { at };
        if cut { damaged.truncate(at) } else { damaged[at..at + 3].copy_from_slice(&bytes) }
        for (file, what) in files.iter().zip(WHAT) {
            fs::write(path(folder.path(), "car", Split::Test, what), file).unwrap();
        }
        let read = NpzFolder::open(folder.path(), Split::Test).and_then(|files| {
            (0..files.count(0)).try_for_each(|shape| {
                files.voxels(0, shape)?;
                assert_eq!(files.picture(0, shape, 23)?.len(), 4 * 64 * 64);
                Ok(())
            })
        });
        if let Err(error) = read {
            let line = format!("{error:#}");
            prop_assert!(line.contains("car_test_") && !line.contains('\n'), "{}", line);
        }
    }
}
