//! JSON files of cameras: what is wrong in them is said with its place.

use std::path::Path;

use anyhow::{Context, anyhow};
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Fields that hold one number.
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

/// A file as JSON.
pub(crate) fn json(path: &Path) -> anyhow::Result<Value> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the camera file {}", path.display()))?;
    serde_json::from_str(&text).map_err(|error| match not_finite(&text) {
        Some(place) => {
            anyhow!(
                "{}: {place} is NaN or infinite: calibrate anew, or leave its frame out",
                path.display()
            )
        }
        None => anyhow!("{}: {error}", path.display()),
    })
}

/// The fields of an object as a type, or the first that has another one.
pub(crate) fn typed<T: DeserializeOwned>(object: &Value) -> anyhow::Result<T> {
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

/// Stands for a number that is none.
const MARK: &str = "\u{1}not finite";

/// Where a text would be JSON but for a word that some programs write into it, which has none for such numbers: the place of the first.
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
            // What is escaped does not end a string.
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

/// The way to the first mark, as `frames[3].transform_matrix[0][2]`.
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

/// What stands behind a name or an index.
fn dotted(rest: String) -> String {
    if rest.is_empty() || rest.starts_with('[') { rest } else { format!(".{rest}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_none_is_named_by_its_place() {
        let place = |text: &str| not_finite(text);
        assert_eq!(place(r#"{"fx": NaN}"#).as_deref(), Some("fx"));
        let frames = r#"{"frames": [{"file_path": "NaN \" NaN", "depth": null}, {"m": {"t": [[1, -Infinity]]}}]}"#;
        assert_eq!(place(frames).as_deref(), Some("frames[1].m.t[0][1]"));
        // Broken for another reason, or not at all.
        assert_eq!(place(r#"{"file_path": "Infinity.png", "fx": }"#), None);
        assert_eq!(place(r#"{"file_path": "Infinity.png"}"#), None);
    }
}
