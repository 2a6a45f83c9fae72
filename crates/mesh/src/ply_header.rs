//! The header of a PLY file: its elements, their properties, and the encoding.

use crate::{
    Fault,
    error::{Trouble, shown},
    number::Number,
    statements::next_line,
};

/// The encoding; binary files state the byte order of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) encoding: Encoding,
    pub(crate) elements: Vec<Element>,
    /// Number of lines of the header: the body starts on the next.
    pub(crate) lines: usize,
}

#[derive(Debug)]
pub(crate) struct Element {
    pub(crate) name: String,
    /// According to the header, unchecked.
    pub(crate) count: u64,
    pub(crate) properties: Vec<Property>,
    /// Line of the header, from 1.
    pub(crate) line: usize,
}

#[derive(Debug)]
pub(crate) struct Property {
    pub(crate) name: String,
    /// Type of the number of entries, for a list.
    pub(crate) list: Option<Number>,
    pub(crate) number: Number,
}

/// The type called `name`.
fn number_type(name: &str) -> Result<Number, Fault> {
    Ok(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return Err(Fault::format(format!("{:?} is not a type of PLY", shown(name)))),
    })
}

impl Header {
    /// Removes the header from `bytes`.
    pub(crate) fn read(bytes: &mut &[u8]) -> Result<Self, Trouble> {
        let (mut lines, mut encoding, mut elements) = (0, None, Vec::new());
        loop {
            lines += 1;
            let last = bytes.is_empty();
            let line = String::from_utf8_lossy(next_line(bytes).unwrap_or_default());
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            let done = match (lines, words.as_slice()) {
                (1, ["ply"]) => Ok(false),
                (1, _) => Err(Fault::format("not a PLY file: its first line is not \"ply\"")),
                (_, ["end_header"]) => Ok(true),
                _ if last => Err(Fault::format("the file ends before end_header")),
                (_, words) => statement(words, lines, &mut encoding, &mut elements).map(|()| false),
            };
            let at = |fault| Trouble::Line(lines, fault);
            if done.map_err(at)? {
                let missing =
                    || at(Fault::format("the header has no line that starts with format"));
                return Ok(Self { encoding: encoding.ok_or_else(missing)?, elements, lines });
            }
        }
    }
}

fn statement(
    words: &[&str],
    line: usize,
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> Result<(), Fault> {
    match *words {
        ["format", "ascii", "1.0", ..] => *encoding = Some(Encoding::Ascii),
        ["format", "binary_little_endian", "1.0", ..] => *encoding = Some(Encoding::LittleEndian),
        ["format", "binary_big_endian", "1.0", ..] => *encoding = Some(Encoding::BigEndian),
        ["element", name, count, ..] => {
            let not_whole = |_| Fault::format(format!("{:?} is not a count", shown(count)));
            let count = count.parse().map_err(not_whole)?;
            elements.push(Element { name: shown(name), count, properties: Vec::new(), line });
        }
        ["property", "list", count, number, name, ..] => {
            let list = number_type(count)?;
            if !list.is_whole() {
                return Err(Fault::format("the length of a list must be of a whole type"));
            }
            add(elements, name, Some(list), number_type(number)?)?;
        }
        ["property", number, name, ..] if number != "list" => {
            add(elements, name, None, number_type(number)?)?
        }
        ["format" | "element" | "property", ..] => {
            let text = shown(&words.join(" "));
            return Err(Fault::format(format!(
                "{text:?} does not belong in the header of PLY 1.0"
            )));
        }
        // Comments, `obj_info`, and lines that programs write without either.
        _ => {}
    }
    Ok(())
}

fn add(
    elements: &mut [Element],
    name: &str,
    list: Option<Number>,
    number: Number,
) -> Result<(), Fault> {
    let before = || Fault::format("a property comes before the first element");
    let element = elements.last_mut().ok_or_else(before)?;
    element.properties.push(Property { name: shown(name), list, number });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_ends_right_before_the_body_whatever_ends_its_lines() {
        for end in ["\n", "\r\n", "\r"] {
            let lines = ["ply", "format binary_big_endian 1.0", "comment a b", "element face 2"];
            let more = ["property list uint8 int vertex_indices", "end_header"];
            let text = lines.into_iter().chain(more).map(|line| line.to_owned() + end);
            let file = text.collect::<String>() + "body";
            let mut rest = file.as_bytes();
            let Ok(header) = Header::read(&mut rest) else { panic!("a sound header") };
            assert_eq!((rest, header.lines), (b"body".as_slice(), 6));
            assert_eq!(header.encoding, Encoding::BigEndian);
            assert_eq!((header.elements[0].count, header.elements[0].line), (2, 4));
            let property = &header.elements[0].properties[0];
            assert_eq!((property.list, property.number), (Some(Number::U8), Number::I32));
        }
    }
}
