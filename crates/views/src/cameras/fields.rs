//! Fields of camera files. Errors include the file and the field.

use std::{borrow::Cow, path::Path};

use anyhow::{Context, anyhow, ensure};
use serde::de::DeserializeOwned;
use serde_json::Value;
use softrast_mesh::read_bounded;

use super::calibration;

/// Fields with a single number.
const NUMBERS: [&str; 20] = [
    "fl_x",
    "fl_y",
    "fx",
    "fy",
    "cx",
    "cy",
    "w",
    "h",
    "width",
    "height",
    "camera_angle_x",
    "camera_angle_y",
    "k1",
    "k2",
    "k3",
    "k4",
    "k5",
    "k6",
    "p1",
    "p2",
];

/// Characters of a name in an error.
const LONGEST_NAME: usize = 200;
/// Largest camera file in bytes: 100,000 frames need less.
const LARGEST_FILE: u64 = 1 << 25;
/// Positions in world units beyond this do not fit the floats used for drawing.
const FARTHEST: f64 = 1e15;

/// A file name for an error: on one line, and shortened.
pub(super) fn short(name: &str) -> String {
    let mut letters = name.chars().map(|letter| if letter.is_control() { ' ' } else { letter });
    let start: String = letters.by_ref().take(LONGEST_NAME).collect();
    if letters.next().is_some() { format!("{start}…") } else { start }
}

/// The content of a camera file, and its path as its name.
pub(super) fn read(path: &Path) -> anyhow::Result<(Vec<u8>, String)> {
    let name = path.display().to_string();
    let bytes = read_bounded(path, LARGEST_FILE)
        .with_context(|| format!("cannot read the camera file {name}"))?;
    Ok((bytes, name))
}

/// The content of the camera file `name` as JSON, also for a calibration in YAML.
pub(super) fn json(bytes: &[u8], name: &str) -> anyhow::Result<Value> {
    let text = text(bytes).with_context(|| name.to_owned())?;
    let parsed = serde_json::from_str(&text).or_else(|error| calibration::yaml(&text).ok_or(error));
    let file: Value = parsed.map_err(|error| match not_finite(&text) {
        Some(place) => {
            anyhow!("{name}: {place} is NaN or infinite: calibrate anew, or leave its frame out")
        }
        None => anyhow!("{name}: {error}"),
    })?;
    ensure!(file.is_object(), "{name}: it has no fields of a camera: a JSON object is expected");
    calibration::as_lens(file).with_context(|| name.to_owned())
}

/// A text in UTF-8, with or without a byte order mark, or in UTF-16 with one, as written by shells of Windows.
fn text(bytes: &[u8]) -> anyhow::Result<Cow<'_, str>> {
    let of_16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text: Option<String> = char::decode_utf16(units).map(Result::ok).collect();
        text.filter(|_| bytes.len().is_multiple_of(2)).map(Cow::Owned)
    };
    let text = match bytes {
        [0xff, 0xfe, rest @ ..] => of_16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => of_16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => str::from_utf8(rest).ok().map(Cow::Borrowed),
        all => str::from_utf8(all).ok().map(Cow::Borrowed),
    };
    text.context("the file is no text in UTF-8: save it as that")
}

/// An error if t is not a position that can be drawn from.
pub(super) fn check_place(translation: [f64; 3]) -> anyhow::Result<()> {
    let near = translation.iter().all(|x| x.abs() <= FARTHEST);
    ensure!(
        near,
        "the camera is at t = {translation:?}, farther than {FARTHEST:e} world units: take other units"
    );
    Ok(())
}

/// The fields of an object as a type, or an error for the first field of another type.
pub(super) fn typed<T: DeserializeOwned>(object: &Value) -> anyhow::Result<T> {
    for name in NUMBERS {
        let value = &object[name];
        if !(value.is_null() || value.is_number()) {
            return Err(anyhow!("{name} is {value}, not a number"));
        }
    }
    serde_json::from_value(object.clone()).map_err(|error| {
        let matrix =
            ["K", "R", "t", "transform_matrix"].into_iter().find(|name| !object[name].is_null());
        match matrix {
            Some(name) => anyhow!("{error} (in {name}?)"),
            None => anyhow!("{error}"),
        }
    })
}

/// String in place of a number that is not finite.
const MARK: &str = "\u{1}not finite";

/// The place of the first non-finite number in a text that is JSON except for such words, which some programs write.
fn not_finite(text: &str) -> Option<String> {
    let marked = marked(text);
    let whole: Value = serde_json::from_str(&marked).ok()?;
    place_of_mark(&whole)
}

/// The text with a string in place of every word for a number that is not finite.
fn marked(text: &str) -> String {
    let mark = Value::from(MARK).to_string();
    let (mut marked, mut rest, mut in_string) = (String::with_capacity(text.len()), text, false);
    while let Some(next) = rest.chars().next() {
        let word = ["-Infinity", "Infinity", "NaN"].into_iter().find(|word| rest.starts_with(word));
        let taken = match (in_string, word) {
            (false, Some(word)) => {
                marked.push_str(&mark);
                rest = &rest[word.len()..];
                continue;
            }
            // An escaped character does not end a string.
            (true, _) if next == '\\' => {
                rest.char_indices().nth(2).map_or(rest.len(), |(at, _)| at)
            }
            _ => next.len_utf8(),
        };
        in_string ^= next == '"';
        marked.push_str(&rest[..taken]);
        rest = &rest[taken..];
    }
    marked
}

/// The path to the first mark, such as `frames[3].transform_matrix[0][2]`.
fn place_of_mark(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => (text == MARK).then(String::new),
        Value::Array(values) => {
            let of = |(k, value): (usize, &Value)| {
                Some(format!("[{k}]{}", dotted(place_of_mark(value)?)))
            };
            values.iter().enumerate().find_map(of)
        }
        Value::Object(fields) => {
            let of = |(name, value): (&String, &Value)| {
                Some(format!("{name}{}", dotted(place_of_mark(value)?)))
            };
            fields.iter().find_map(of)
        }
        _ => None,
    }
}

/// The rest of a path, after a name or an index.
fn dotted(rest: String) -> String {
    if rest.is_empty() || rest.starts_with('[') { rest } else { format!(".{rest}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_text_and_utf_16_is_read_with_one() {
        let plain = "{\"file_path\": \"füchse/01.png\"}";
        let utf_16 = |mark: char| format!("{mark}{plain}").encode_utf16().collect::<Vec<u16>>();
        let little: Vec<u8> =
            utf_16('\u{feff}').iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = utf_16('\u{feff}').iter().flat_map(|unit| unit.to_be_bytes()).collect();
        let marked = format!("\u{feff}{plain}").into_bytes();
        for bytes in [plain.as_bytes(), &marked, &little, &big] {
            assert_eq!(json(bytes, "a.json").unwrap()["file_path"], "füchse/01.png");
        }
        // Truncated within a character, half of a surrogate pair, or another encoding.
        for bytes in [&little[..5], &[0xff, 0xfe, 0x00, 0xd8], b"{\"a\": \"f\xfcchse\"}"] {
            let error = format!("{:#}", json(bytes, "a.json").unwrap_err());
            assert_eq!(error, "a.json: the file is no text in UTF-8: save it as that");
        }
    }

    #[test]
    fn a_number_that_is_none_is_named_by_its_place() {
        let place = |text: &str| not_finite(text);
        assert_eq!(place(r#"{"fx": NaN}"#).as_deref(), Some("fx"));
        let frames = r#"{"frames": [{"file_path": "NaN \" NaN", "depth": null}, {"m": {"t": [[1, -Infinity]]}}]}"#;
        assert_eq!(place(frames).as_deref(), Some("frames[1].m.t[0][1]"));
        // Invalid for another reason, or valid.
        assert_eq!(place(r#"{"file_path": "Infinity.png", "fx": }"#), None);
        assert_eq!(place(r#"{"file_path": "Infinity.png"}"#), None);
    }
}
