//! Text and binary STL files.
//!
//! Not read by the existing crate, which rounds the numbers of text to 32 bits, and takes every file that starts with "solid" for text.

use std::collections::HashMap;

use crate::{
    Fault,
    error::{Trouble, shown},
    mesh::finite,
    parts::Parts,
    statements::{next_line, number},
};

/// Length of the arbitrary header of a binary file, before the number of triangles.
const HEADER: usize = 80;
/// Bytes of a triangle: a normal, three corners of three 32-bit floats, and two arbitrary bytes.
const TRIANGLE: usize = 50;
const NORMAL: usize = 12;

const NO_FACES: Trouble = Trouble::NoFaces("an STL file is a list of triangles, this one is empty");

/// The mesh in `bytes`; see [`Mesh::parse`](crate::Mesh::parse).
pub(crate) fn parse(bytes: &[u8]) -> Result<Parts, Trouble> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut surface = Surface::default();
    let starts_like_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| {
        // A binary file may also start with this word, but text has no zeros.
        word.eq_ignore_ascii_case(b"solid") && !bytes[..bytes.len().min(1024)].contains(&0)
    });
    if starts_like_text && claimed(bytes) != Some(bytes.len() as u64) {
        text(bytes, &mut surface)?;
    } else {
        binary(bytes, &mut surface)?;
    }
    let Surface { positions, faces, .. } = surface;
    if faces.is_empty() {
        Err(NO_FACES)
    } else {
        Ok(Parts { positions, faces, ..Parts::default() })
    }
}

/// The number of triangles according to a binary file.
fn count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER..)?.first_chunk()?;
    Some(u32::from_le_bytes(*count))
}

/// The expected length of a binary file, in bytes.
fn claimed(bytes: &[u8]) -> Option<u64> {
    Some((HEADER + 4) as u64 + TRIANGLE as u64 * u64::from(count(bytes)?))
}

fn binary(bytes: &[u8], surface: &mut Surface) -> Result<(), Trouble> {
    let length = bytes.len();
    let Some((count, claimed)) = count(bytes).zip(claimed(bytes)) else {
        let reason = format!("neither text that starts with solid nor 84 bytes long: {length}");
        return Err(Trouble::part("header", reason));
    };
    if claimed > length as u64 {
        let reason = format!("{count} triangles take {claimed} bytes, but the file has {length}");
        return Err(Trouble::part("header", reason));
    }
    let triangles = bytes[HEADER + 4..].chunks_exact(TRIANGLE).take(count as usize);
    for (number, triangle) in triangles.enumerate() {
        let floats = triangle[NORMAL..].as_chunks().0.iter().map(|&x| f32::from_le_bytes(x).into());
        let floats: Vec<f64> = floats.collect();
        let &[a, b, c] = floats.as_chunks().0 else { unreachable!("nine floats in 38 bytes") };
        let add = surface.add([a, b, c]);
        add.map_err(|fault| Trouble::Part(format!("triangle {number}"), fault))?;
    }
    Ok(())
}

fn text(mut bytes: &[u8], surface: &mut Surface) -> Result<(), Trouble> {
    let (mut line, mut state) = (0, State::Closed);
    while let Some(words) = next_line(&mut bytes) {
        line += 1;
        statement(&String::from_utf8_lossy(words), &mut state, surface)
            .map_err(|fault| Trouble::Line(line, fault))?;
    }
    let open = match state {
        State::Closed => return Ok(()),
        State::Named | State::Open => "solid",
        State::Facet(_) => "facet",
    };
    let reason = format!("the file ends before end{open}");
    Err(Trouble::Line(line, Fault::format(reason)))
}

/// Parser state of a text.
enum State {
    /// Before and between solids.
    Closed,
    /// In a solid, before its first facet: its name may take several lines, and some programs write the line twice.
    Named,
    /// In a solid, after a facet.
    Open,
    /// In a facet with these corners.
    Facet(Vec<[f64; 3]>),
}

/// Parses one line.
fn statement(line: &str, state: &mut State, surface: &mut Surface) -> Result<(), Fault> {
    let mut words = line.split_ascii_whitespace();
    let Some(first) = words.next() else { return Ok(()) };
    let mut word = first.to_ascii_lowercase();
    // Some programs write the words that end a part as two.
    if word == "end" {
        word += &words.next().unwrap_or_default().to_ascii_lowercase();
    }
    match (word.as_str(), &mut *state) {
        ("solid", State::Closed | State::Open) => *state = State::Named,
        ("endsolid", State::Closed | State::Named | State::Open) => *state = State::Closed,
        ("facet", State::Named | State::Open) => *state = State::Facet(Vec::new()),
        (_, State::Named) => {}
        ("outer" | "endloop", State::Facet(_)) => {}
        ("vertex", State::Facet(corners)) => corners.push(position(words)?),
        ("endfacet", State::Facet(corners)) => {
            let &[a, b, c] = corners.as_slice() else {
                let reason = format!("a facet has three corners: found {}", corners.len());
                return Err(Fault::format(reason));
            };
            surface.add([a, b, c])?;
            *state = State::Open;
        }
        _ => return Err(Fault::format(format!("{:?} does not belong here", shown(first)))),
    }
    Ok(())
}

fn position<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], Fault> {
    let mut position = [0.0; 3];
    for (found, x) in position.iter_mut().enumerate() {
        let word = words.next().ok_or(Fault::Coordinates(found))?;
        *x = number(word)?;
    }
    finite(position)?;
    Ok(position)
}

/// Triangles that share corners at equal positions.
#[derive(Default)]
struct Surface {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    vertices: HashMap<[u64; 3], u32>,
}

impl Surface {
    fn add(&mut self, triangle: [[f64; 3]; 3]) -> Result<(), Fault> {
        let mut face = [0; 3];
        for (corner, position) in face.iter_mut().zip(triangle) {
            finite(position)?;
            // Adding 0 turns -0 into 0.
            let place = position.map(|x| (x + 0.0).to_bits());
            let next = u32::try_from(self.positions.len());
            let next = next.map_err(|_| Fault::format("more vertices than 32 bits can number"))?;
            *corner = *self.vertices.entry(place).or_insert_with(|| {
                self.positions.push(position);
                next
            });
        }
        self.faces.push(face);
        Ok(())
    }
}
