//! Printing of paths and messages.

use std::{borrow::Cow, path::Path};

/// A path as text, for JSON, pages and lines, which are UTF-8: invalid bytes become U+FFFD.
pub fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// The text with its control characters escaped, except line feeds and tabs, so that a file name cannot send commands to a terminal.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c.escape_default().to_string())
}

/// JSON in one line, with the control characters that JSON allows in strings escaped too.
pub(crate) fn printable_json(json: &str) -> Cow<'_, str> {
    escaped(json, |c| format!("\\u{:04x}", u32::from(c)))
}

fn escaped(text: &str, escape: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.chars().any(commands) {
        return text.into();
    }
    let part = |c: char| if commands(c) { escape(c) } else { c.into() };
    text.chars().map(part).collect::<String>().into()
}

/// Whether a terminal interprets a character: control characters, and those that change the direction of text.
fn commands(c: char) -> bool {
    let turns = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && !matches!(c, '\n' | '\t')) || turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_and_lines_stay_lines() {
        assert_eq!(printable("a\u{1b}[31m\r\u{9b}b\n\tc é"), "a\\u{1b}[31m\\r\\u{9b}b\n\tc é");
        assert_eq!(printable("\u{202e}gpj.exe"), "\\u{202e}gpj.exe");
        assert!(matches!(printable("as it is"), Cow::Borrowed(_)));
    }

    #[test]
    fn escaped_json_is_the_same_value() {
        let value = serde_json::json!({ "a\u{9b}": "\u{7f}\u{1b}\u{202e}é" });
        let text = value.to_string();
        let safe = printable_json(&text);
        assert!(!safe.chars().any(commands), "{safe}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&safe).unwrap(), value);
    }
}
