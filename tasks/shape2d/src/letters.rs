//! Letters made of strokes.

/// A line between two points, in units of the height of the letter.
pub(crate) type Line = [[f64; 2]; 2];

/// Width of every letter, and of the gap between two, in units of its height.
const WIDTH: f64 = 0.7;
const GAP: f64 = 0.2;
/// Half the width of a stroke in units of the height.
pub(crate) const HALF_STROKE: f64 = 0.09;

/// Positions of strokes: half their width inside the edges of the letter.
const LOW: f64 = HALF_STROKE;
const HIGH: f64 = 1.0 - HALF_STROKE;
const MIDDLE: f64 = 0.5;
const LEFT: f64 = HALF_STROKE;
const RIGHT: f64 = WIDTH - HALF_STROKE;

/// The lines of a word from (0, 0) to the right, of height 1, and its width.
///
/// Only the letters S, O, F and T are defined; others are blank.
pub(crate) fn word(text: &str) -> (Vec<Line>, f64) {
    let placed = text.chars().enumerate().flat_map(|(k, character)| {
        let x = k as f64 * (WIDTH + GAP);
        letter(character).into_iter().map(move |line| line.map(|[px, py]| [px + x, py]))
    });
    (placed.collect(), text.chars().count() as f64 * (WIDTH + GAP) - GAP)
}

fn letter(character: char) -> Vec<Line> {
    match character {
        'S' => {
            let radius = (HIGH - MIDDLE) / 2.0;
            let [left, right] = [LEFT + radius, RIGHT - radius];
            let mut lines = arc([left, HIGH - radius], radius, [90.0, 270.0]);
            lines.extend(arc([right, LOW + radius], radius, [-90.0, 90.0]));
            lines.push([[left, HIGH], [RIGHT - 0.04, HIGH]]);
            lines.push([[left, MIDDLE], [right, MIDDLE]]);
            lines.push([[LEFT + 0.04, LOW], [right, LOW]]);
            lines
        }
        'O' => {
            let radius = (RIGHT - LEFT) / 2.0;
            let middle = WIDTH / 2.0;
            let mut lines = arc([middle, HIGH - radius], radius, [0.0, 180.0]);
            lines.extend(arc([middle, LOW + radius], radius, [180.0, 360.0]));
            lines.extend([LEFT, RIGHT].map(|x| [[x, LOW + radius], [x, HIGH - radius]]));
            lines
        }
        'F' => vec![
            [[LEFT, LOW], [LEFT, HIGH]],
            [[LEFT, HIGH], [RIGHT, HIGH]],
            [[LEFT, MIDDLE], [RIGHT - 0.1, MIDDLE]],
        ],
        'T' => vec![[[WIDTH / 2.0, LOW], [WIDTH / 2.0, HIGH]], [[LEFT, HIGH], [RIGHT, HIGH]]],
        _ => Vec::new(),
    }
}

/// Short lines along a circle, between two ascending angles in degrees; 0 is right, 90 up.
pub(crate) fn arc(centre: [f64; 2], radius: f64, [from, to]: [f64; 2]) -> Vec<Line> {
    const PIECES: usize = 24;
    let at = |k: usize| {
        let (sin, cos) = (from + (to - from) * k as f64 / PIECES as f64).to_radians().sin_cos();
        [centre[0] + radius * cos, centre[1] + radius * sin]
    };
    (0..PIECES).map(|k| [at(k), at(k + 1)]).collect()
}
