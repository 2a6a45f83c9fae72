//! Calibrations as written by OpenCV and ROS, in JSON or YAML, converted to the fields of a [`Lens`](super::Lens).
//!
//! YAML is parsed by a custom parser: OpenCV's files start with a line that YAML does not allow.

use anyhow::{bail, ensure};
use serde_json::{Map, Value, json};

const MATRICES: [&str; 3] = ["camera_matrix", "cameraMatrix", "mtx"];
const COEFFICIENTS: [&str; 5] =
    ["distortion_coefficients", "dist_coeffs", "distCoeffs", "dist_coeff", "dist"];
const WIDTHS: [&str; 3] = ["image_width", "width", "w"];
const HEIGHTS: [&str; 3] = ["image_height", "height", "h"];
const SIZES: [&str; 3] = ["image_size", "img_size", "imageSize"];
const MODELS: [&str; 2] = ["distortion_model", "camera_model"];
const FISHEYES: [&str; 2] = ["is_fisheye", "fisheye_model"];
/// Other names of the models `OPENCV` and `OPENCV_FISHEYE` of a [`Lens`](super::Lens).
const OPENCV: [&str; 3] = ["plumb_bob", "rational_polynomial", "radtan"];
const FISHEYE: [&str; 3] = ["equidistant", "kannala_brandt", "kannala_brandt4"];
/// Names of coefficients.
const OWN: [&str; 9] = ["distortion", "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];

/// The camera of a file with a `camera_matrix`, in the fields of a lens; other files are unchanged.
///
/// OpenCV counts pixels from the centre of the first one, which is half a pixel from the border.
pub(super) fn as_lens(file: Value) -> anyhow::Result<Value> {
    let first = |names: &[&str]| {
        names.iter().map(|name| &file[*name]).find(|value| !value.is_null()).cloned()
    };
    let Some(matrix) = first(&MATRICES) else { return Ok(file) };
    let entries: Vec<f64> = numbers(&matrix).iter().filter_map(Value::as_f64).collect();
    ensure!(
        entries.len() == 9,
        "camera_matrix has {} numbers: three rows of three are expected",
        entries.len()
    );
    let beside = ["K", "cx", "cy"].into_iter().find(|name| !file[*name].is_null());
    if let Some(name) = beside {
        bail!("camera_matrix and {name} say the same: leave one of them out");
    }
    let rows = [0, 1, 2].map(|row| {
        let half = if row < 2 { 0.5 } else { 0.0 };
        let entry = |column: usize| entries[3 * row + column];
        [entry(0), entry(1), entry(2) + half]
    });
    let mut lens = file.as_object().cloned().unwrap_or_default();
    for name in
        [&MATRICES[..], &COEFFICIENTS, &WIDTHS, &HEIGHTS, &SIZES, &MODELS, &FISHEYES].concat()
    {
        lens.remove(name);
    }
    lens.insert("K".into(), json!(rows));
    let size = first(&SIZES).map(|size| numbers(&size)).unwrap_or_default();
    let sides = [("w", &WIDTHS, size.first()), ("h", &HEIGHTS, size.get(1))];
    for (name, names, of_size) in sides {
        if let Some(side) = first(names).or(of_size.cloned()) {
            lens.insert(name.into(), side);
        }
    }
    if let Some(coefficients) = first(&COEFFICIENTS) {
        lens.insert("distortion".into(), numbers(&coefficients).into());
    }
    if let Some(model) = first(&MODELS).as_ref().and_then(Value::as_str) {
        let is = |names: &[&str]| names.iter().any(|name| model.eq_ignore_ascii_case(name));
        let known = if is(&OPENCV) {
            "OPENCV"
        } else if is(&FISHEYE) {
            "OPENCV_FISHEYE"
        } else {
            model
        };
        lens.insert("camera_model".into(), known.into());
    }
    if let Some(fisheye) = first(&FISHEYES) {
        // OpenCV writes 0 and 1.
        let is_fisheye = fisheye.as_bool().or(fisheye.as_f64().map(|number| number != 0.0));
        lens.insert("is_fisheye".into(), is_fisheye.unwrap_or(fisheye == "true").into());
    }
    Ok(lens.into())
}

/// The numbers of a matrix: its rows, or the list `data` of OpenCV's.
fn numbers(matrix: &Value) -> Vec<Value> {
    match matrix {
        Value::Array(rows) => rows.iter().flat_map(numbers).collect(),
        Value::Object(fields) => fields.get("data").map(numbers).unwrap_or_default(),
        number => vec![number.clone()],
    }
}

/// The fields of a calibration in YAML: numbers, words, and the numbers of matrices; `None` for other texts.
pub(super) fn yaml(text: &str) -> Option<Value> {
    // Without comments.
    let text: Vec<&str> =
        text.lines().map(|line| line.split(" #").next().unwrap_or(line)).collect();
    let text = text.join("\n");
    let mut fields = Map::new();
    let names = [&MATRICES[..], &COEFFICIENTS, &WIDTHS, &HEIGHTS, &SIZES, &MODELS, &FISHEYES, &OWN];
    for name in names.concat() {
        let Some(own) = own(&text, name) else { continue };
        let first = own.lines().next().unwrap_or_default().trim();
        let value = match first.chars().next() {
            // A matrix on the lines below.
            None | Some('!' | '[' | '{') => list(own)?,
            Some(_) => scalar(first),
        };
        fields.insert(name.to_owned(), value);
    }
    let is_calibration = MATRICES.iter().any(|name| fields.contains_key(*name));
    is_calibration.then_some(fields.into())
}

/// The text after a name up to the next name, which starts a line.
fn own<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let mut start = 0;
    let mut found = None;
    for line in text.split_inclusive('\n') {
        let begins = line.starts_with(|letter: char| letter.is_ascii_alphabetic());
        match found {
            Some(from) if begins => return Some(&text[from..start]),
            None => {
                let rest = line.strip_prefix(name).and_then(|rest| rest.strip_prefix(':'));
                found = rest.map(|rest| start + line.len() - rest.len());
            }
            _ => {}
        }
        start += line.len();
    }
    found.map(|from| &text[from..])
}

/// The numbers of a list: all rows in brackets, after `data` if there are rows and columns; or those of lines that start with `-`.
fn list(text: &str) -> Option<Value> {
    let text = text.split_once("data:").map_or(text, |(_, data)| data);
    if !text.contains('[') {
        let items = text.lines().filter(|line| line.trim_start().starts_with('-'));
        let words = items.filter_map(|line| line.rsplit("- ").next()).map(str::trim);
        return Some(words.filter(|word| !word.is_empty()).map(scalar).collect());
    }
    let start = text.find('[')?;
    let mut depth = 0;
    let end = text[start..].find(|letter| {
        depth += i32::from(letter == '[') - i32::from(letter == ']');
        depth == 0
    })?;
    let words = text[start..start + end]
        .split(|letter: char| "[],".contains(letter) || letter.is_whitespace());
    Some(words.filter(|word| !word.is_empty()).map(scalar).collect())
}

/// A number, or a word. OpenCV writes `640.` and `.5`, which are invalid JSON.
fn scalar(word: &str) -> Value {
    let word = word.trim_matches(['"', '\'']);
    match word.parse::<f64>() {
        Ok(number) if number.fract() == 0.0 && number.abs() < 1e9 => json!(number as i64),
        Ok(number) => json!(number),
        Err(_) => json!(word),
    }
}

#[cfg(test)]
mod tests {
    use softrast_raster::ImageSize;

    use crate::Lens;

    const OPENCV: &str = "%YAML:1.0\n---\ncalibration_time: \"Fri\"\nimage_width: 640\nimage_height: 480\n\
        camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 5.0e+02, 0., 319.5, 0.,\n       510., 239.5, 0., 0., 1. ]\n\
        distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ -.25, .125, 0., 0., 0. ]\navg_error: .3\n";
    const ROS: &str = "image_width: 640\nimage_height: 480\ncamera_name: narrow\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [500, 0, 319.5, 0, 510, 239.5, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  \
        data: [-0.25, 0.125, 0, 0, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";
    const SCRIPT: &str = "camera_matrix: [[500.0, 0.0, 319.5], [0.0, 510.0, 239.5],\n  [0.0, 0.0, 1.0]]\ndist_coeff: [[-0.25, 0.125, 0.0, 0.0, 0.0]]\n";
    const BLOCKS: &str = "camera_matrix:\n- - 500.0\n  - 0.0\n  - 319.5\n- - 0.0\n  - 510.0\n  - 239.5\n- - 0.0\n  - 0.0\n  - 1.0\n\
        dist_coeff:\n- - -0.25\n  - 0.125\n  - 0.0\n  - 0.0\n  - 0.0\n";
    const COMMENTS: &str = "camera_matrix:\n  [500, 0, 319.5, 0, 510, 239.5, 0, 0, 1] # 9\nimage_width: 640 # px\nk1: -0.25\nk2: 0.125\n\
        distortion_model: plumb_bob # not a fisheye\nfisheye_model: 0\n";
    const JSON: &str = r#"{"camera_matrix": {"rows": 3, "cols": 3, "data": [500, 0, 319.5, 0, 510, 239.5, 0, 0, 1]},
        "distortion_coefficients": {"data": [-0.25, 0.125, 0, 0, 0]}, "image_width": 640, "image_height": 480}"#;
    const LISTS: &str = r#"{"mtx": [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]], "dist": [[-0.25, 0.125, 0, 0, 0]], "img_size": [640, 480]}"#;

    #[test]
    fn all_forms_of_a_calibration_are_one_lens() {
        let size = ImageSize::from([480, 640]);
        let lens = Lens::parse(
            br#"{"fx": 500, "fy": 510, "cx": 320, "cy": 240, "k1": -0.25, "k2": 0.125}"#,
            "a.json",
        );
        let expected = lens.and_then(|lens| lens.camera(size)).unwrap();
        assert!(expected.1.is_some());
        for text in [OPENCV, ROS, SCRIPT, BLOCKS, COMMENTS, JSON, LISTS] {
            for text in [text.to_owned(), text.replace('\n', "\r\n")] {
                let lens = Lens::parse(text.as_bytes(), "calibration.yaml").unwrap();
                assert_eq!(lens.camera(size).unwrap(), expected, "{text}");
            }
        }
        let other = Lens::parse(OPENCV.as_bytes(), "a.yml").unwrap();
        assert!(other.camera(ImageSize::from([48, 64])).is_err());
        let fisheye =
            ROS.replace("plumb_bob", "equidistant").replace("0, 0, 0]\nrect", "0, 0]\nrect");
        let (_, distortion) =
            Lens::parse(fisheye.as_bytes(), "a.yaml").unwrap().camera(size).unwrap();
        assert_ne!(distortion, expected.1);
        let of_opencv = OPENCV
            .replace("avg_error", "fisheye_model: 1\navg_error")
            .replace("0., 0., 0. ]", "0., 0. ]");
        let (_, same) = Lens::parse(of_opencv.as_bytes(), "a.yaml").unwrap().camera(size).unwrap();
        assert_eq!(same, distortion);
    }

    #[test]
    fn what_is_no_calibration_is_one_line() {
        for (text, message) in [
            (
                "camera_matrix: [[1, 0], [0, 1]]\n",
                "a.yaml: camera_matrix has 4 numbers: three rows of three are expected",
            ),
            (
                "camera_matrix: [500, 0, x, 0, 510, 239, 0, 0, 1]\n",
                "a.yaml: camera_matrix has 8 numbers: three rows of three are expected",
            ),
            ("hello: 1\n", "a.yaml: expected value at line 1 column 1"),
            ("camera_matrix: [500, 0", "a.yaml: expected value at line 1 column 1"),
        ] {
            let error = format!("{:#}", Lens::parse(text.as_bytes(), "a.yaml").unwrap_err());
            assert_eq!(error, message);
        }
        let twice = JSON.replacen('{', r#"{"cx": 320, "#, 1);
        let error = format!("{:#}", Lens::parse(twice.as_bytes(), "a.json").unwrap_err());
        assert_eq!(error, "a.json: camera_matrix and cx say the same: leave one of them out");
        let size = ImageSize::from([480, 640]);
        let refused = |text: &str| {
            Lens::parse(text.as_bytes(), "a.yaml").and_then(|lens| lens.camera(size)).is_err()
        };
        assert!(refused(&ROS.replace("plumb_bob", "thin_prism")));
        assert!(refused("camera_matrix: [500, 0, 0, 0, 510, 0, 319.5, 239.5, 1]\n"), "transposed");
    }
}
