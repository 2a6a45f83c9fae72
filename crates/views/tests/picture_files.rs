//! Picture files in practice: rotated by cameras, with palettes and few levels, invalid, or too large.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, io::Cursor, path::Path};

use image::{
    DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, RgbImage,
    metadata::Orientation,
};
use softrast_views::{MaskRules, Picture, PictureFile};

const PLAIN: MaskRules = MaskRules { invert: false, threshold: None, label: None };

fn encoded(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn mask(bytes: &[u8]) -> Result<Picture, String> {
    let mask = PictureFile::decode(bytes).and_then(|file| Picture::mask_of(&file, &PLAIN));
    mask.map_err(|error| format!("{error:#}"))
}

/// Exif data with an orientation.
fn exif(orientation: u8) -> Vec<u8> {
    [&b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"[..], &[orientation, 0, 0, 0], &[0; 4]]
        .concat()
}

/// A chunk of a PNG file.
fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let body = [&kind[..], content].concat();
    let sum = body.iter().fold(u32::MAX, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 }
        })
    });
    [&(content.len() as u32).to_be_bytes()[..], &body, &(!sum).to_be_bytes()].concat()
}

/// A PNG file with this bit depth and colour type, with chunks before its pixels: bytes of rows, each after a 0.
fn png(size: [u32; 2], [bits, kind]: [u8; 2], chunks: &[u8], rows: &[u8]) -> Vec<u8> {
    let [width, height] = size.map(u32::to_be_bytes);
    let head = [&width[..], &height, &[bits, kind, 0, 0, 0]].concat();
    // One block that is not compressed.
    let length = (rows.len() as u16).to_le_bytes();
    let sum = rows.iter().fold([1u32, 0], |[a, b], &byte| {
        let a = (a + u32::from(byte)) % 65_521;
        [a, (b + a) % 65_521]
    });
    let sum = ((sum[1] << 16) | sum[0]).to_be_bytes();
    let zlib = [&[0x78, 1, 1][..], &length, &length.map(|byte| !byte), rows, &sum].concat();
    let parts =
        [chunk(b"IHDR", &head), chunks.to_vec(), chunk(b"IDAT", &zlib), chunk(b"IEND", &[])];
    [&b"\x89PNG\r\n\x1a\n"[..], &parts.concat()].concat()
}

#[test]
fn pictures_are_turned_as_their_exif_data_ask_for_all_eight_values() {
    let level = |x: u32, y: u32| if x < 16 { (10 * x + 2 * y) as u8 } else { 255 };
    let in_file = GrayImage::from_fn(48, 32, |x, y| Luma([level(x, y)]));
    let (jpeg, png) =
        (encoded(in_file.clone(), ImageFormat::Jpeg), encoded(in_file, ImageFormat::Png));
    for orientation in 1..=8 {
        let exif = exif(orientation);
        let marked = [b"Exif\0\0", &exif[..]].concat();
        let length = (marked.len() as u16 + 2).to_be_bytes();
        let jpeg = [&jpeg[..2], b"\xff\xe1", &length, &marked, &jpeg[2..]].concat();
        // The first chunk of a PNG file ends after 33 bytes; others may come after the pixels too.
        let (before, after) = (chunk(b"eXIf", &exif), png.len() - 12);
        let files = [
            jpeg,
            [&png[..33], &before, &png[33..]].concat(),
            [&png[..after], &before, &png[after..]].concat(),
        ];
        for bytes in files {
            let mut expected = image::load_from_memory(&bytes).unwrap();
            expected.apply_orientation(Orientation::from_exif(orientation).unwrap());
            let picture = mask(&bytes).unwrap();
            let size = picture.whole_size();
            assert_eq!(
                [size.width as u32, size.height as u32],
                [expected.width(), expected.height()]
            );
            let expected: Vec<f32> =
                expected.to_luma8().pixels().map(|p| f32::from(p.0[0]) / 255.0).collect();
            assert_eq!(picture.pixels(), expected, "orientation {orientation}");
            // A texture is not rotated.
            let texels = PictureFile::decode(&bytes).unwrap().texels(1 << 20);
            assert_eq!(texels.dimensions(), (48, 32));
        }
    }
}

#[test]
fn one_level_above_black_is_the_mask_in_every_kind_of_picture() {
    let inside = |x: u32, y: u32| (2..5).contains(&x) && (1..4).contains(&y);
    let expected: Vec<f32> = (0..48).map(|k| f32::from(u8::from(inside(k % 8, k / 8)))).collect();
    let of = |level: u8| move |x: u32, y: u32| if inside(x, y) { level } else { 0 };
    let gray = |level: u8| GrayImage::from_fn(8, 6, |x, y| Luma([of(level)(x, y)]));
    let wide = ImageBuffer::from_fn(8, 6, |x, y| Luma([u16::from(of(255)(x, y))]));
    let alpha = GrayAlphaImage::from_fn(8, 6, |x, y| LumaA([0, of(7)(x, y)]));
    let red = RgbImage::from_fn(8, 6, |x, y| Rgb([of(128)(x, y), 0, 0]));
    let rows: Vec<u8> =
        (0..6).flat_map(|y| [vec![0], (0..8).map(|x| of(1)(x, y)).collect()].concat()).collect();
    let dark = png([8, 6], [8, 3], &chunk(b"PLTE", &[0, 0, 0, 0, 0, 128]), &rows);
    let files: [(Vec<u8>, f64); 6] = [
        (encoded(gray(1), ImageFormat::Png), 1.0 / 255.0),
        (encoded(gray(200), ImageFormat::Png), 200.0 / 255.0),
        (encoded(DynamicImage::ImageLuma16(wide), ImageFormat::Png), 255.0 / 65_535.0),
        (encoded(alpha, ImageFormat::Png), 7.0 / 255.0),
        (encoded(red, ImageFormat::Png), 0.2126 * 128.0 / 255.0),
        (dark, 0.0722 * 128.0 / 255.0),
    ];
    for (bytes, level) in files {
        let found = mask(&bytes).unwrap();
        assert_eq!(found.pixels(), expected);
        assert!((found.only_level().unwrap() - level).abs() < 1e-6, "{level}");
    }
    let plain = mask(&encoded(gray(255), ImageFormat::Png)).unwrap();
    assert_eq!((plain.pixels(), plain.only_level()), (&expected[..], None));
}

#[test]
fn numbers_of_classes_are_one_line_with_the_threshold_that_takes_the_brightest() {
    let classes = GrayImage::from_fn(9, 9, |x, _| Luma([(x % 4) as u8]));
    let bytes = encoded(classes, ImageFormat::Png);
    let error = mask(&bytes).unwrap_err();
    assert!(error.contains("the mask is empty") && error.contains("--threshold 0.011"), "{error}");
    let rules = MaskRules { threshold: Some(0.011), ..PLAIN };
    let file = PictureFile::decode(&bytes).unwrap();
    let found = Picture::mask_of(&file, &rules).unwrap();
    assert_eq!(found.pixels()[..5], [0.0, 0.0, 0.0, 1.0, 0.0]);
    // Colours hidden by an alpha channel.
    let hidden = GrayAlphaImage::from_pixel(4, 4, LumaA([255, 0]));
    let error = mask(&encoded(hidden, ImageFormat::Png)).unwrap_err();
    assert!(error.contains("all of it is transparent"), "{error}");
}

#[test]
fn a_palette_that_is_none_and_a_picture_without_pixels_are_one_line() {
    for bytes in [0, 4, 5, 767, 3 * 257, 3 * 300] {
        let palette = chunk(b"PLTE", &vec![9; bytes]);
        for bits in [1, 2, 4, 8] {
            let error = mask(&png([1, 1], [bits, 3], &palette, &[0, 0])).unwrap_err();
            assert!(error.contains(&format!("its palette has {bytes} bytes")), "{error}");
        }
        // If pixels do not refer to it, it is an optional hint.
        assert!(PictureFile::decode(&png([1, 1], [8, 2], &palette, &[0, 9, 9, 9])).is_ok());
    }
    for size in [[0, 0], [0, 3], [3, 0]] {
        let [w, h] = size.map(|x| x as u8);
        let gif = [&b"GIF89a"[..], &[w, 0, h, 0, 0, 0, 0], b",\0\0\0\0\0\0\0\0\0\x02\0;"].concat();
        let error = mask(&gif).unwrap_err();
        assert!(error.contains("no pixels") && error.lines().count() == 1, "{error}");
    }
}

#[test]
fn what_is_too_large_is_refused_by_its_head() {
    for (size, kind, part) in [
        ([30_000, 30_000], [8, 0], "30000 x 30000 pixels"),
        ([70_000, 1], [8, 0], "70000 x 1 pixels"),
        ([12_000, 12_000], [8, 6], "at most 65535 along a side and 512 MiB"),
        ([u32::MAX >> 1, u32::MAX >> 1], [16, 6], ""),
    ] {
        let error = mask(&png(size, kind, &[], &[0])).unwrap_err();
        assert!(error.contains(part) && error.lines().count() == 1, "{error}");
    }
}

#[test]
fn bytes_of_any_kind_are_a_picture_or_one_line() {
    let gray = GrayImage::from_fn(20, 12, |x, y| Luma([(9 * x + y) as u8]));
    let palette = chunk(b"PLTE", &[1; 12]);
    let files = [
        encoded(gray.clone(), ImageFormat::Png),
        encoded(gray.clone(), ImageFormat::Jpeg),
        encoded(DynamicImage::from(gray).to_rgba8(), ImageFormat::Gif),
        png([2, 1], [4, 3], &palette, &[0, 0x13]),
    ];
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) as usize
    };
    for whole in files {
        for _ in 0..400 {
            let mut bytes = whole.clone();
            for _ in 0..1 + next() % 4 {
                let at = next() % bytes.len();
                bytes[at] = next() as u8;
            }
            bytes.truncate(bytes.len() - next() % 8 * (next() % 8));
            if let Err(error) = mask(&bytes) {
                assert!(!error.is_empty() && error.lines().count() == 1, "{error}");
            }
        }
    }
}

#[test]
fn a_large_picture_is_reduced_and_its_camera_with_it() {
    let large =
        GrayImage::from_fn(5000, 1500, |x, y| Luma([if x < 2500 && y >= 750 { 255 } else { 0 }]));
    let picture = mask(&encoded(large, ImageFormat::Png)).unwrap();
    let (whole, size) = (picture.whole_size(), picture.size());
    assert_eq!([whole.width, whole.height], [5000, 1500]);
    assert!(size.pixels() <= 1 << 22 && size.pixels() > (1 << 22) - 6000, "{size:?}");
    let mean = picture.pixels().iter().map(|&x| f64::from(x)).sum::<f64>() / size.pixels() as f64;
    assert!((mean - 0.25).abs() < 1e-6, "{mean}");
    assert_eq!([picture.pixels()[0], picture.pixels()[size.pixels() - size.width]], [0.0, 1.0]);
    let lens =
        softrast_views::Lens::parse(br#"{"fx": 4000, "cx": 2000, "w": 5000, "h": 1500}"#, "a")
            .unwrap();
    let camera = lens.pinhole(whole).unwrap();
    let reduced = picture.camera(&camera);
    assert_eq!(reduced.size, size);
    let ([x, y, _], [u, v, _]) =
        (camera.pixel([0.1, -0.05, 2.0]), reduced.pixel([0.1, -0.05, 2.0]));
    let share = |at: f64, pixels: usize| at / pixels as f64;
    assert!((share(x, 5000) - share(u, size.width)).abs() < 1e-12);
    assert!((share(y, 1500) - share(v, size.height)).abs() < 1e-12);
    let back = picture.whole_camera(&reduced);
    assert_eq!(back.size, whole);
    assert!((back.focal[0] - 4000.0).abs() < 1e-9 && (back.centre[0] - 2000.0).abs() < 1e-9);
}

#[test]
fn only_regular_files_are_read() {
    for path in ["/dev/zero", env!("CARGO_MANIFEST_DIR"), "no.png"] {
        let errors = [
            Picture::load_mask(path).err(),
            Picture::load_luminance(path).err(),
            softrast_views::Lens::load(path).err(),
            softrast_views::PoseFile::load(path).err(),
            softrast_views::CameraFile::load(path).err(),
        ];
        for error in errors.map(|error| format!("{:#}", error.unwrap())) {
            assert!(error.contains(path) && error.lines().count() == 1, "{error}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("transforms.json")).unwrap();
    let load = |path: &Path| Picture::load_mask(path);
    assert!(softrast_views::load_views(folder.path(), load).is_err());
}
