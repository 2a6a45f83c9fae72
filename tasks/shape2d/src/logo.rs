use softrast_cli::Variant;

use crate::letters::{HALF_STROKE, Line, arc, word};

/// A black-and-white drawing in NDC: x to the right, y up, both from -1 to 1.
///
/// White are a few lines with round ends and a few boxes.
#[derive(Clone, Debug, PartialEq)]
pub struct Logo {
    strokes: Vec<(Line, f64)>,
    /// Lower left and upper right corner of each box.
    boxes: Vec<[[f64; 2]; 2]>,
}

impl Logo {
    /// The logo of a variant: letters that cover about 9 % of the image, or a skyline below letters
    /// that together cover about 29 %.
    ///
    /// Drawn for this project. The paper's pictures have the same coverage (docs/notes.md, 2D shape).
    pub fn of(variant: Variant) -> Self {
        match variant {
            Variant::Original => Self::letters(0.0, 0.53),
            Variant::Transfer => Self::skyline(),
        }
    }

    /// The word SOFT in the middle between both sides.
    fn letters(middle: f64, height: f64) -> Self {
        let (lines, width) = word("SOFT");
        let place = |[x, y]: [f64; 2]| [height * (x - width / 2.0), middle + height * (y - 0.5)];
        let strokes = lines.into_iter().map(|line| (line.map(place), height * HALF_STROKE));
        Self { strokes: strokes.collect(), boxes: Vec::new() }
    }

    fn skyline() -> Self {
        let mut logo = Self::letters(0.62, 0.44);
        logo.boxes = vec![
            // The ground, and houses from left to right.
            [[-0.95, -0.95], [0.95, -0.84]],
            [[-0.92, -0.84], [-0.74, -0.45]],
            [[-0.7, -0.84], [-0.56, -0.2]],
            [[-0.52, -0.84], [-0.3, -0.45]],
            [[-0.24, -0.84], [-0.06, -0.1]],
            [[-0.02, -0.84], [0.2, -0.48]],
            [[0.74, -0.84], [0.92, -0.4]],
        ];
        // A pointed tower, and a wheel with its stand.
        logo.strokes.push(([[-0.15, -0.1], [-0.15, 0.16]], 0.02));
        let hub = [0.47, -0.4];
        let rim = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [hub[0] + 0.22 * cos, hub[1] + 0.22 * sin]
        };
        logo.strokes.extend(arc(hub, 0.22, [0.0, 360.0]).into_iter().map(|line| (line, 0.03)));
        logo.strokes.extend([0.0, 60.0, 120.0].map(|a| ([rim(a), rim(a + 180.0)], 0.012)));
        logo.strokes.extend([-0.13, 0.13].map(|x| ([hub, [hub[0] + x, -0.84]], 0.025)));
        logo
    }

    /// The image `[size * size]`, top row first, 0 black to 1 white; edges are smooth.
    pub fn image(&self, size: usize) -> Vec<f64> {
        /// Samples along either side of a pixel.
        const SAMPLES: usize = 4;
        let step = 2.0 / (size * SAMPLES) as f64;
        let at = |sample: usize| (sample as f64 + 0.5) * step - 1.0;
        let pixel = |pixel: usize| {
            let [column, row] = [pixel % size, pixel / size].map(|k| k * SAMPLES);
            let samples = (0..SAMPLES * SAMPLES).map(|k| [column + k % SAMPLES, row + k / SAMPLES]);
            let inside = samples.filter(|&[x, y]| self.contains([at(x), -at(y)])).count();
            inside as f64 / (SAMPLES * SAMPLES) as f64
        };
        (0..size * size).map(pixel).collect()
    }

    fn contains(&self, p: [f64; 2]) -> bool {
        let in_box =
            |[low, high]: &[[f64; 2]; 2]| (0..2).all(|k| low[k] <= p[k] && p[k] <= high[k]);
        let on_stroke = |(line, half): &(Line, f64)| squared_distance(p, line) <= half * half;
        self.boxes.iter().any(in_box) || self.strokes.iter().any(on_stroke)
    }
}

/// Squared distance from a point to a line of non-zero length.
fn squared_distance(p: [f64; 2], &[from, to]: &Line) -> f64 {
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let along = [to[0] - from[0], to[1] - from[1]];
    let offset = [p[0] - from[0], p[1] - from[1]];
    let t = (dot(offset, along) / dot(along, along)).clamp(0.0, 1.0);
    let away = [offset[0] - t * along[0], offset[1] - t * along[1]];
    dot(away, away)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logos_cover_as_much_as_those_of_the_paper() {
        for (variant, expected) in [(Variant::Original, 0.09), (Variant::Transfer, 0.29)] {
            let image = Logo::of(variant).image(256);
            let covered = image.iter().sum::<f64>() / image.len() as f64;
            assert!((covered - expected).abs() < 0.01, "{variant:?}: {covered}");
        }
    }

    #[test]
    fn committed_files_are_what_is_drawn() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/logos");
        for (name, variant) in [("letters", Variant::Original), ("skyline", Variant::Transfer)] {
            let file = image::open(format!("{folder}/{name}.png")).unwrap().into_luma8();
            let drawn = Logo::of(variant).image(256);
            let same = file.pixels().zip(&drawn).all(|(p, x)| p.0[0] == (x * 255.0).round() as u8);
            assert!(same && file.dimensions() == (256, 256), "{name}: run the example make_logos");
        }
    }

    #[test]
    fn the_top_row_is_the_top() {
        let logo = Logo { strokes: Vec::new(), boxes: vec![[[0.0, 0.0], [1.0, 1.0]]] };
        assert_eq!(logo.image(2), [0.0, 1.0, 0.0, 0.0]);
    }
}
