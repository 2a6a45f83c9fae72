//! Reads text OFF files.
//!
//! No existing crate reads the variants that programs write.

use crate::{
    Fault,
    colours::{Beyond, Colours},
    error::{Place, Trouble, shown},
    mesh::finite,
    parts::Parts,
    polygon::Polygons,
    statements::{Statement, number, statements, whole},
};

const NO_FACES: Trouble =
    Trouble::NoFaces("an OFF file lists them after its vertices, as many as its second line says");

/// The mesh in `bytes`; see [`Mesh::parse`](crate::Mesh::parse).
pub(crate) fn parse(bytes: &[u8]) -> Result<Parts, Trouble> {
    let mut lines = statements(bytes).filter(|line| line.words().next().is_some());
    let Header { coloured, skipped, vertices, faces } = Header::read(&mut lines)?;
    if faces == 0 {
        return Err(NO_FACES);
    }
    let mut next = |name: &str, number: usize| {
        let place = || Trouble::Part(format!("{name} {number}"), Fault::Truncated);
        lines.next().ok_or_else(place)
    };
    let mut positions = Vec::new();
    let mut channels = Vec::new();
    for vertex in 0..vertices {
        let line = next("vertex", vertex)?;
        let numbers: Vec<Result<f64, Fault>> = line.words().take(skipped + 3).map(number).collect();
        let position = || {
            let [x, y, z] = numbers.first_chunk().ok_or(Fault::Coordinates(numbers.len()))?;
            let position = [x.clone()?, y.clone()?, z.clone()?];
            finite(position)?;
            Ok(position)
        };
        positions.push(position().map_err(|fault| Trouble::Line(line.line, fault))?);
        if coloured {
            let channel = |k: usize| match numbers.get(skipped + k) {
                Some(Ok(number)) => *number,
                _ => f64::NAN,
            };
            channels.push((line.line, [0, 1, 2].map(channel)));
        }
    }
    let mut polygons = Polygons::default();
    for face in 0..faces {
        let line = next("face", face)?;
        corners(&line, vertices, &mut polygons).map_err(|fault| Trouble::Line(line.line, fault))?;
    }
    let faces = polygons.faces(&polygons.cut(&positions)?);
    let (colours, warning) = if coloured { settled(&channels) } else { (None, None) };
    Ok(Parts { positions, faces, colours, warnings: Vec::from_iter(warning), ..Parts::default() })
}

/// The colours of vertices and a warning if they are not as the lines have them: from 0 to 1, or whole numbers to 255.
fn settled(channels: &[(usize, [f64; 3])]) -> (Option<Vec<[f64; 3]>>, Option<Trouble>) {
    let mut all = channels.iter().flat_map(|(_, channels)| channels);
    let levels = all.clone().all(|x| x.fract() == 0.0) && all.any(|&x| x > 1.0);
    let mut colours = Colours::new([if levels { 255.0 } else { 1.0 }; 3], Beyond::LeftOut);
    for &(line, channels) in channels {
        colours.push(channels, || Place::Line(line));
    }
    colours.settled()
}

/// The first lines: the kind of file and its counts.
struct Header {
    /// Whether vertices have colours, and how many numbers precede them.
    coloured: bool,
    skipped: usize,
    vertices: usize,
    faces: usize,
}

impl Header {
    fn read<'a>(lines: &mut impl Iterator<Item = Statement<'a>>) -> Result<Self, Trouble> {
        let first = lines.next().ok_or(NO_FACES)?;
        let wrong = |line: usize, reason: &str| Trouble::Line(line, Fault::format(reason));
        let mut words: Vec<&str> = first.words().collect();
        let Some((kind, after)) = words[0].split_once("OFF") else {
            return Err(wrong(first.line, "not an OFF file: it does not start with OFF"));
        };
        if words.get(1).is_some_and(|word| word.eq_ignore_ascii_case("binary")) {
            return Err(wrong(first.line, "binary OFF files are not read: export it as text"));
        }
        let kind = kind.strip_prefix("ST").or(kind.strip_suffix("ST")).unwrap_or(kind);
        // Some programs write NC for colours before the normal.
        let (skipped, coloured) = match kind {
            "" | "N" => (3, false),
            "C" | "NC" => (3, true),
            "CN" => (6, true),
            _ => {
                let reason =
                    format!("{:?} is not read: only three dimensions are", shown(words[0]));
                return Err(wrong(first.line, &reason));
            }
        };
        // Some programs write the numbers in the first line, some even without a space.
        match after {
            "" => drop(words.remove(0)),
            _ => words[0] = after,
        }
        let second;
        let (line, words) = match words.is_empty() {
            false => (first.line, words),
            true => {
                second = lines
                    .next()
                    .ok_or_else(|| Trouble::Part("header".to_owned(), Fault::Truncated))?;
                (second.line, second.words().collect())
            }
        };
        let mut counts = words.iter().map(|word| word.parse::<u32>().ok().map(|n| n as usize));
        match (counts.next().flatten(), counts.next().flatten()) {
            (Some(vertices), Some(faces)) => Ok(Self { coloured, skipped, vertices, faces }),
            _ => Err(wrong(line, "it should say how many vertices and faces there are")),
        }
    }
}

/// Adds the polygon of a line: the number of its corners, then their vertices. A colour may follow.
fn corners(line: &Statement, vertices: usize, polygons: &mut Polygons) -> Result<(), Fault> {
    let mut words = line.words();
    let arity: u32 = whole(words.next().unwrap_or_default())?;
    if arity < 3 {
        return Err(Fault::Corners(arity as usize));
    }
    for found in 0..arity {
        let Some(word) = words.next() else {
            return Err(Fault::format(format!("{arity} corners, but the line has {found}")));
        };
        let vertex =
            u32::try_from(whole::<i64>(word)?).ok().filter(|&vertex| (vertex as usize) < vertices);
        let beyond = || Fault::OutOfRange { index: word.to_owned(), vertices };
        polygons.corners.push(vertex.ok_or_else(beyond)?);
    }
    polygons.arities.push(arity);
    Ok(())
}
