//! Text and binary PLY files, read and written.
//!
//! Not read by the existing crates: they read the numbers of text as 32 bits if the header says float, keep every property of every vertex,
//! and loop as often as the header claims for an element without properties.

use std::slice::ChunksExact;

use crate::{
    Fault, Mesh,
    colours::{Beyond, Colours},
    error::{Place, Trouble},
    mesh::finite,
    number::Number,
    parts::Parts,
    ply_header::{Element, Encoding, Header, Property},
    polygon::Polygons,
    statements::{next_line, number, whole},
};

const AXES: [[&str; 2]; 3] = [["x", "x"], ["y", "y"], ["z", "z"]];
/// Most programs use the first name of each, some older ones the second.
const CHANNELS: [[&str; 2]; 3] =
    [["red", "diffuse_red"], ["green", "diffuse_green"], ["blue", "diffuse_blue"]];

const NO_FACES: Trouble = Trouble::NoFaces("a PLY file lists them in its element face");

/// The mesh in `bytes`; see [`Mesh::parse`].
pub(crate) fn parse(mut bytes: &[u8]) -> Result<Parts, Trouble> {
    let Header { encoding, elements, lines } = Header::read(&mut bytes)?;
    let vertices = element(&elements, "vertex")?.map_or(0, |vertex| vertex.count);
    if let Some(strips) = element(&elements, "tristrips")?.filter(|strips| strips.count > 0) {
        let reason = "tristrips are not read: export the mesh with faces";
        return Err(Trouble::Line(strips.line, Fault::format(reason)));
    }
    if element(&elements, "face")?.is_none_or(|face| face.count == 0) {
        return Err(NO_FACES);
    }

    let mut body = Body { rest: bytes, encoding, line: lines };
    let (mut positions, mut polygons) = (Vec::new(), Polygons::default());
    let mut colours = None;
    for element in &elements {
        match element.name.as_str() {
            "vertex" => {
                let mut take = |[x, y, z]: [&[f64]; 3]| {
                    let position = [x[0], y[0], z[0]];
                    finite(position)?;
                    positions.push(position);
                    Ok(())
                };
                let is_one = |p: &Property| p.list.is_none();
                let [x, y, z] = columns(element, AXES, is_one, "number")?;
                // A colour requires all three.
                match columns(element, CHANNELS, is_one, "number") {
                    Ok(channels) => {
                        let full = channels.map(|column| full(&element.properties[column]));
                        let colours = colours.insert(Colours::new(full, Beyond::LeftOut));
                        let [red, green, blue] = channels;
                        let columns = [x, y, z, red, green, blue];
                        body.rows(element, &columns, 3, |place, [x, y, z, red, green, blue]| {
                            colours.push([red[0], green[0], blue[0]], place);
                            take([x, y, z])
                        })?;
                    }
                    Err(_) => body.rows(element, &[x, y, z], 3, |_, axes| take(axes))?,
                }
            }
            "face" => {
                let wanted = [["vertex_indices", "vertex_index"]];
                let whole = |p: &Property| p.list.is_some() && p.number.is_whole();
                let columns = columns(element, wanted, whole, "list of whole numbers")?;
                body.rows(element, &columns, 1, |_, [indices]| {
                    if indices.len() < 3 {
                        return Err(Fault::Corners(indices.len()));
                    }
                    for &index in indices {
                        polygons.corners.push(vertex(index, vertices)?);
                    }
                    polygons.arities.push(indices.len() as u32);
                    Ok(())
                })?;
            }
            _ => body.rows(element, &[], 0, |_, []| Ok(()))?,
        }
    }

    let faces = polygons.faces(&polygons.cut(&positions)?);
    let (colours, warning) = colours.map_or((None, None), Colours::settled);
    Ok(Parts { positions, faces, colours, warnings: Vec::from_iter(warning), ..Parts::default() })
}

/// The value of a channel of a colour that stands for 1.
fn full(channel: &Property) -> f64 {
    match channel.number {
        Number::F32 | Number::F64 => 1.0,
        Number::U16 => u16::MAX.into(),
        _ => u8::MAX.into(),
    }
}

/// The one element called `name`, if any.
fn element<'a>(elements: &'a [Element], name: &str) -> Result<Option<&'a Element>, Trouble> {
    let mut all = elements.iter().filter(|element| element.name == name);
    let first = all.next();
    match all.next() {
        Some(second) => {
            let reason = Fault::format(format!("the header has a second element {name}"));
            Err(Trouble::Line(second.line, reason))
        }
        None => Ok(first),
    }
}

/// Columns of the properties `wanted` in `element`, each under either of two names.
fn columns<const N: usize>(
    element: &Element,
    wanted: [[&str; 2]; N],
    fits: impl Fn(&Property) -> bool,
    kind: &str,
) -> Result<[usize; N], Trouble> {
    let mut columns = [0; N];
    for (column, names) in columns.iter_mut().zip(wanted) {
        let named = |p: &Property| names.contains(&p.name.as_str()) && fits(p);
        *column = element.properties.iter().position(named).ok_or_else(|| {
            let reason = format!("element {} has no {kind} {}", element.name, names[0]);
            Trouble::Line(element.line, Fault::format(reason))
        })?;
    }
    Ok(columns)
}

/// The vertex of a corner; `index` is an integer of at most 32 bits, or was text.
fn vertex(index: f64, vertices: u64) -> Result<u32, Fault> {
    if index >= 0.0 && index < vertices as f64 && index <= f64::from(u32::MAX) {
        return Ok(index as u32);
    }
    Err(Fault::OutOfRange { index: index.to_string(), vertices: vertices as usize })
}

/// The rest of the file after the header, from the current position.
struct Body<'a> {
    rest: &'a [u8],
    encoding: Encoding,
    /// Number of the latest line; text only.
    line: usize,
}

impl<'a> Body<'a> {
    /// Passes the values of the properties `columns` of each row of `element` to `take`, with the place of the row. Text that is not a
    /// number is an error in the first `strict` columns, and NaN in the others.
    fn rows<const N: usize>(
        &mut self,
        element: &Element,
        columns: &[usize; N],
        strict: usize,
        mut take: impl FnMut(&dyn Fn() -> Place, [&[f64]; N]) -> Result<(), Fault>,
    ) -> Result<(), Trouble> {
        let ascii = self.encoding == Encoding::Ascii;
        let least: usize =
            element.properties.iter().map(|p| p.list.unwrap_or(p.number).size()).sum();
        // Elements without properties take no bytes, whatever their count.
        if least == 0 {
            return Ok(());
        }
        // A text has at least a digit and a separator for each value, except the last separator.
        let least = if ascii { 2 * element.properties.len() } else { least } as u64;
        let room = self.rest.len() as u64 + u64::from(ascii);
        if element.count.checked_mul(least).is_none_or(|bytes| bytes > room) {
            let Element { name, count, .. } = element;
            let rest = self.rest.len();
            let reason = format!("{count} do not fit into the {rest} bytes after what is before");
            return Err(Trouble::part(format!("element {name}"), reason));
        }
        let mut values: [Vec<f64>; N] = std::array::from_fn(|_| Vec::new());
        for row in 0..element.count {
            values.iter_mut().for_each(Vec::clear);
            let read = match self.encoding {
                Encoding::Ascii => self.text_row(element, columns, strict, &mut values),
                _ => self.binary_row(element, columns, &mut values),
            };
            let part = || Place::Part(format!("{} {row}", element.name));
            let place = || if ascii { Place::Line(self.line) } else { part() };
            let taken = read.and_then(|()| take(&place, values.each_ref().map(Vec::as_slice)));
            taken.map_err(|fault| {
                let place = if fault == Fault::Truncated { part() } else { place() };
                place.trouble(fault)
            })?;
        }
        Ok(())
    }

    /// The next line that is not blank. Values beyond those of the header are skipped: some programs write colours there.
    fn text_row(
        &mut self,
        element: &Element,
        columns: &[usize],
        strict: usize,
        values: &mut [Vec<f64>],
    ) -> Result<(), Fault> {
        let line = loop {
            let line = next_line(&mut self.rest).ok_or(Fault::Truncated)?;
            self.line += 1;
            if !line.trim_ascii().is_empty() {
                break String::from_utf8_lossy(line);
            }
        };
        let mut words = line.split_ascii_whitespace();
        let missing =
            |name: &str| Fault::format(format!("the line ends before {name} is complete"));
        for (p, Property { name, list, number }) in element.properties.iter().enumerate() {
            let mut word = || words.next().ok_or_else(|| missing(name));
            let count = match list {
                Some(_) => length(parsed(word()?, true)?)?,
                None => 1,
            };
            let column = columns.iter().position(|&column| column == p);
            for _ in 0..count {
                let word = word()?;
                if let Some(column) = column {
                    let whole = list.is_some() && number.is_whole();
                    values[column].push(match parsed(word, whole) {
                        Err(_) if column >= strict => f64::NAN,
                        value => value?,
                    });
                }
            }
        }
        Ok(())
    }

    fn binary_row(
        &mut self,
        element: &Element,
        columns: &[usize],
        values: &mut [Vec<f64>],
    ) -> Result<(), Fault> {
        for (p, Property { list, number, .. }) in element.properties.iter().enumerate() {
            let count = match list {
                Some(list) => length(self.bytes(1, *list)?.map(|n| self.number(n, *list)).sum())?,
                None => 1,
            };
            let numbers = self.bytes(count, *number)?;
            if let Some(column) = columns.iter().position(|&column| column == p) {
                values[column].extend(numbers.map(|bytes| self.number(bytes, *number)));
            }
        }
        Ok(())
    }

    /// Removes `count` numbers from the body, each as its bytes.
    fn bytes(&mut self, count: usize, number: Number) -> Result<ChunksExact<'a, u8>, Fault> {
        let size = number.size();
        let taken = count.checked_mul(size).and_then(|length| self.rest.split_at_checked(length));
        let (bytes, rest) = taken.ok_or(Fault::Truncated)?;
        self.rest = rest;
        Ok(bytes.chunks_exact(size))
    }

    /// The value of `bytes`, whose number is that of the type.
    fn number(&self, bytes: &[u8], number: Number) -> f64 {
        if self.encoding == Encoding::LittleEndian {
            return number.of_le(bytes);
        }
        let mut low = [0; 8];
        let low = &mut low[..bytes.len()];
        low.copy_from_slice(bytes);
        low.reverse();
        number.of_le(low)
    }
}

/// The value of a word; `is_whole` for an index or a length.
fn parsed(word: &str, is_whole: bool) -> Result<f64, Fault> {
    if is_whole { whole::<i64>(word).map(|n| n as f64) } else { number(word) }
}

/// The length of a list; the caller checks whether the file has this many entries.
fn length(entries: f64) -> Result<usize, Fault> {
    if entries < 0.0 {
        return Err(Fault::format(format!("a list cannot have {entries} entries")));
    }
    Ok(entries as usize)
}

/// See [`Mesh::to_ply`].
pub(crate) fn bytes(mesh: &Mesh) -> Vec<u8> {
    let (positions, faces) = (mesh.positions(), mesh.faces());
    let channels = match mesh.colours() {
        Some(_) => "property uchar red\nproperty uchar green\nproperty uchar blue\n",
        None => "",
    };
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\n\
        property double y\nproperty double z\n{channels}element face {}\n\
        property list uchar uint vertex_indices\nend_header\n",
        positions.len(),
        faces.len()
    )
    .into_bytes();
    for (vertex, position) in positions.iter().enumerate() {
        file.extend(position.iter().flat_map(|x| x.to_le_bytes()));
        if let Some(colours) = mesh.colours() {
            file.extend(colours[vertex].map(|x| (x * f64::from(u8::MAX)).round() as u8));
        }
    }
    for corners in faces {
        file.push(3);
        file.extend(corners.iter().flat_map(|v| v.to_le_bytes()));
    }
    file
}
