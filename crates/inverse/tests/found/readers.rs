//! The readers of pictures, cameras and softnesses, each with valid seed files and checks of the results.

use image::{DynamicImage, GrayImage, ImageFormat, Luma, RgbImage};
use serde_json::json;
use softrast_inverse::{ScheduledSoftness, SoftnessFileError};
use softrast_views::{CameraFile, Lens, MaskRules, Picture, PictureFile, PoseFile};

/// A reader under test. The names of its files begin with the `name`.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) ending: &'static str,
    pub(crate) seeds: fn() -> Vec<Vec<u8>>,
    pub(crate) read: fn(&[u8]),
}

pub(crate) fn all() -> Vec<Kind> {
    vec![
        Kind { name: "png", ending: "png", seeds: pngs, read: picture },
        Kind { name: "jpeg", ending: "jpg", seeds: || encoded(ImageFormat::Jpeg), read: picture },
        Kind { name: "gif", ending: "gif", seeds: || encoded(ImageFormat::Gif), read: picture },
        Kind {
            name: "lens",
            ending: "json",
            seeds: lenses,
            read: |bytes| {
                let read =
                    Lens::parse(bytes, "a.json").and_then(|lens| lens.camera([90, 120].into()));
                if let Some((camera, distortion)) = checked(read) {
                    let numbers = camera.focal.iter().chain(&camera.centre);
                    assert!(numbers.copied().all(f64::is_finite), "{camera:?}");
                    if let Some(distortion) = distortion {
                        let levels = (0..90 * 120).map(|k| (k % 7) as f32 / 7.0).collect();
                        let picture = Picture::new(levels, 120).undistorted(&camera, &distortion);
                        assert!(picture.pixels().iter().all(|x| (0.0..1.0).contains(x)));
                    }
                }
            },
        },
        Kind {
            name: "pose",
            ending: "json",
            seeds: poses,
            read: |bytes| {
                if let Some(pose) = checked(PoseFile::parse(bytes, "a.json")) {
                    let numbers = pose.rotation.as_flattened().iter().chain(&pose.translation);
                    assert!(numbers.copied().all(f64::is_finite), "{pose:?}");
                }
            },
        },
        Kind {
            name: "transforms",
            ending: "json",
            seeds: transforms,
            read: |bytes| {
                checked(CameraFile::parse(bytes, "a.json"));
            },
        },
        Kind { name: "colmap", ending: "bin", seeds: models, read: model },
        Kind { name: "softness", ending: "json", seeds: softnesses, read: softness },
    ]
}

/// The value that was read; checks that an error is one line.
fn checked<T>(read: anyhow::Result<T>) -> Option<T> {
    let message = match read {
        Ok(read) => return Some(read),
        Err(reason) => format!("{reason:#}"),
    };
    let short = message.chars().count() < 1500;
    assert!(short && !message.contains(char::is_control), "{message:?}");
    None
}

fn picture(bytes: &[u8]) {
    let Some(file) = checked(PictureFile::decode(bytes)) else { return };
    assert!(file.size().pixels() > 0);
    let inverted = MaskRules { invert: true, threshold: Some(0.5), label: None };
    let class = MaskRules { label: Some(1), ..MaskRules::default() };
    // A large picture is read by one rule, as a program reads it: the timing is not the sum of several.
    let rules = [MaskRules::default(), inverted, class];
    let few = if file.size().pixels() > 1 << 20 { 1 } else { rules.len() };
    for rules in &rules[..few] {
        if let Some(mask) = checked(Picture::mask_of(&file, rules)) {
            assert!(mask.size().pixels() > 0);
        }
    }
    assert!(file.texels(1 << 20).pixels().len() <= 1 << 20);
}

fn softness(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match ScheduledSoftness::parse(text, "a.json") {
        Ok(softness) => {
            let phi = softness.phi_at(0.5, 64);
            assert!(phi.iter().copied().all(f64::is_finite), "{phi:?}");
        }
        Err(SoftnessFileError::Parse { .. } | SoftnessFileError::Invalid { .. }) => {}
        Err(other) => panic!("{other}"),
    }
}

/// Pictures of a few pixels in several types.
fn pictures() -> Vec<DynamicImage> {
    let grey = GrayImage::from_fn(7, 5, |x, y| Luma([(37 * x + 51 * y) as u8]));
    let colours = RgbImage::from_fn(9, 4, |x, y| image::Rgb([(29 * x) as u8, (60 * y) as u8, 9]));
    let grey = DynamicImage::from(grey);
    vec![
        DynamicImage::from(grey.to_luma16()),
        DynamicImage::from(grey.to_rgba8()),
        grey,
        DynamicImage::from(colours),
    ]
}

fn encoded(format: ImageFormat) -> Vec<Vec<u8>> {
    let write = |picture: DynamicImage| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = match format {
            ImageFormat::Png => picture,
            _ => DynamicImage::from(picture.to_rgb8()),
        };
        picture.write_to(&mut bytes, format).expect("a picture can be written");
        bytes.into_inner()
    };
    pictures().into_iter().map(write).collect()
}

/// PNG files, one of them with a palette.
fn pngs() -> Vec<Vec<u8>> {
    let mut files = encoded(ImageFormat::Png);
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let sum = kind.iter().chain(data).fold(u32::MAX, |sum, &byte| {
            (0..8).fold(sum ^ u32::from(byte), |sum, _| {
                (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 }
            })
        });
        [&(data.len() as u32).to_be_bytes()[..], kind, data, &(!sum).to_be_bytes()].concat()
    };
    // Two pixels, stored without compression; the last four bytes are Adler's sum.
    let data = [&[0x78, 1, 1, 3, 0, 0xfc, 0xff, 0, 0, 1][..], &[0, 5, 0, 2]].concat();
    files.push(
        [
            &b"\x89PNG\r\n\x1a\n"[..],
            &chunk(b"IHDR", &[0, 0, 0, 2, 0, 0, 0, 1, 8, 3, 0, 0, 0]),
            &chunk(b"PLTE", &[0, 0, 0, 255, 255, 255]),
            &chunk(b"IDAT", &data),
            &chunk(b"IEND", &[]),
        ]
        .concat(),
    );
    files
}

fn texts(values: impl IntoIterator<Item = serde_json::Value>) -> Vec<Vec<u8>> {
    values.into_iter().map(|value| value.to_string().into_bytes()).collect()
}

const EYE: [[f64; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 4.0], [0.0, 0.0, 0.0, 1.0]];

fn lenses() -> Vec<Vec<u8>> {
    texts([
        json!({ "fx": 90.5, "fy": 91.0, "cx": 60.0, "cy": 45.0, "w": 120, "h": 90 }),
        json!({ "K": [[90.0, 0.0, 60.0], [0.0, 90.0, 45.0], [0.0, 0.0, 1.0]] }),
        json!({ "camera_angle_x": 0.7 }),
        json!({ "camera": { "fl_x": 90.0, "k1": 0.0 } }),
        json!({ "fx": 90.0, "k1": -0.2, "k2": 0.1, "p1": 0.01, "camera_model": "OPENCV" }),
        json!({ "fx": 90.0, "distortion": [0.1, 0.0, 0.0, 0.01], "is_fisheye": true }),
    ])
}

fn poses() -> Vec<Vec<u8>> {
    let turn = [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]];
    texts([
        json!({ "R": turn, "t": [0.1, -0.2, 4e3] }),
        json!({ "transform_matrix": EYE }),
        json!({ "camera": { "R": turn, "t": [0.0, 0.0, 1.0] } }),
    ])
}

fn transforms() -> Vec<Vec<u8>> {
    let frame = |name: &str| json!({ "file_path": name, "transform_matrix": EYE });
    texts([
        json!({ "camera_angle_x": 0.7, "frames": [frame("./images/r_0"), frame("b.png")] }),
        json!({ "fl_x": 90.0, "w": 120, "h": 90, "frames": [frame("images\\0001.png")] }),
    ])
}

/// Both files of a COLMAP model, concatenated; this line ends the cameras.
const PARTED: &[u8] = b"\n#parted#\n";

fn models() -> Vec<Vec<u8>> {
    let texts = [
        &b"# cameras\n1 OPENCV 120 90 90 91 60 45 -0.1 0.02 0.001 0\n2 PINHOLE 120 90 90 91 60 45\n"[..],
        b"# images\n1 0.8 0.6 0 0 1 2 3 1 a.png\n1 2 -1\n2 1 0 0 0 0 0 4 2 b c.png\n\n",
    ];
    let numbers =
        |numbers: &[f64]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let cameras = [
        &1u64.to_le_bytes()[..],
        &[1, 0, 0, 0, 2, 0, 0, 0],
        &120u64.to_le_bytes(),
        &90u64.to_le_bytes(),
        &numbers(&[90.0, 60.0, 45.0, 0.1]),
    ]
    .concat();
    let images = [
        &1u64.to_le_bytes()[..],
        &[1, 0, 0, 0],
        &numbers(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0]),
        &[1, 0, 0, 0],
        b"a.png\0",
        &1u64.to_le_bytes(),
        &[0; 24],
    ]
    .concat();
    vec![texts.join(PARTED), [cameras, images].join(PARTED)]
}

/// Reads both files from a folder, as text and as binary.
fn model(bytes: &[u8]) {
    let at = bytes.windows(PARTED.len()).position(|part| part == PARTED);
    let (cameras, images) = bytes.split_at(at.unwrap_or(bytes.len()));
    let images = images.get(PARTED.len()..).unwrap_or_default();
    for ending in ["txt", "bin"] {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, content) in [("cameras", cameras), ("images", images)] {
            let path = folder.path().join(format!("{name}.{ending}"));
            std::fs::write(path, content).expect("a file");
        }
        // The folder name is random.
        let name = folder.path().display().to_string();
        checked(
            CameraFile::load(&folder)
                .map_err(|error| anyhow::anyhow!(format!("{error:#}").replace(&name, ""))),
        );
    }
}

fn softnesses() -> Vec<Vec<u8>> {
    let text = |name| {
        let text = ScheduledSoftness::learned(name).and_then(|softness| softness.text(name));
        text.expect("a bundled softness is sound").into_bytes()
    };
    ScheduledSoftness::learned_names().map(text).collect()
}
