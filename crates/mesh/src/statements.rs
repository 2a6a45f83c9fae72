//! The statements of an OBJ file: its lines without comments, with continued lines joined.

use std::{borrow::Cow, str::FromStr};

use crate::{Fault, error::shown};

/// One statement, and the physical line (from 1) on which it starts.
pub(crate) struct Statement<'a> {
    pub(crate) line: usize,
    text: Cow<'a, str>,
}

impl Statement<'_> {
    /// The fields, separated by spaces and tabs; the first is the keyword.
    pub(crate) fn words(&self) -> impl Iterator<Item = &str> {
        self.text.split([' ', '\t']).filter(|word| !word.is_empty())
    }
}

/// The statements of `bytes`, in order, empty ones included.
///
/// A UTF-8 byte order mark is skipped. LF, CRLF and CR end a line. `#` starts a comment anywhere. A backslash at the very end of a line
/// joins the next one to it, but not at the end of a comment, where it may be part of a path. Bytes of a line that are not UTF-8 become
/// U+FFFD.
pub(crate) fn statements(bytes: &[u8]) -> impl Iterator<Item = Statement<'_>> {
    let mut rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines_read = 0;
    std::iter::from_fn(move || {
        let line = lines_read + 1;
        let mut text = Cow::default();
        while let Some(physical) = next_line(&mut rest) {
            lines_read += 1;
            let comment = physical.iter().position(|&byte| byte == b'#');
            let part = &physical[..comment.unwrap_or(physical.len())];
            let continued = part.strip_suffix(b"\\").filter(|_| comment.is_none());
            text += String::from_utf8_lossy(continued.unwrap_or(part));
            if continued.is_none() {
                break;
            }
        }
        (line <= lines_read).then_some(Statement { line, text })
    })
}

/// Number of statements of `bytes` that start with `keyword`.
pub(crate) fn count(bytes: &[u8], keyword: &str) -> usize {
    statements(bytes).filter(|statement| statement.words().next() == Some(keyword)).count()
}

pub(crate) fn number(word: &str) -> Result<f64, Fault> {
    word.parse().map_err(|_| Fault::Number(shown(word)))
}

pub(crate) fn whole<T: FromStr>(word: &str) -> Result<T, Fault> {
    word.parse().map_err(|_| Fault::format(format!("{:?} is not a whole number", shown(word))))
}

/// Removes the next physical line from `rest`, without its end.
pub(crate) fn next_line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    if rest.is_empty() {
        return None;
    }
    let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
    let (line, after) = rest.split_at(end);
    *rest = match after {
        [b'\r', b'\n', tail @ ..] | [_, tail @ ..] => tail,
        [] => after,
    };
    Some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8]) -> Vec<(usize, String)> {
        let fields = |s: Statement| (s.line, s.words().collect::<Vec<_>>().join(" "));
        statements(text).map(fields).filter(|(_, words)| !words.is_empty()).collect()
    }

    #[test]
    fn every_line_end_counts_one_line() {
        let expected = [(1, "a"), (2, "b"), (3, "c"), (5, "d")].map(|(n, s)| (n, s.to_owned()));
        assert_eq!(read(b"\xef\xbb\xbfa\r\nb\rc\n\nd"), expected);
    }

    #[test]
    fn continued_statement_keeps_the_number_of_its_first_line() {
        let expected = [(1, "f 1 2 3"), (4, "v")].map(|(n, s)| (n, s.to_owned()));
        assert_eq!(read(b"f 1 \\\r\n2 \\\n 3\nv \\"), expected);
    }

    #[test]
    fn comment_does_not_continue() {
        assert_eq!(read(b"# C:\\models\\\nv 1 # x\n"), [(2, "v 1".to_owned())]);
    }
}
