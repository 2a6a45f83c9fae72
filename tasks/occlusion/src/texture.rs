/// Texture of a quad: two shades of a colour in a pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Red, green and blue of the brighter shade, in [0, 1].
    pub colour: [f64; 3],
    /// Pattern of the shades.
    pub pattern: Pattern,
    /// Number of fields of the pattern side by side.
    pub fields: usize,
}

/// Pattern of the two shades of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Like a chess board.
    Checks,
    /// From left to right.
    Stripes,
    /// From the centre outwards.
    Frames,
}

impl Pattern {
    /// All patterns.
    pub const ALL: [Self; 3] = [Self::Checks, Self::Stripes, Self::Frames];
}

/// The darker shade, as a share of the brighter one.
const DARK: f64 = 0.55;

impl Texture {
    /// Colour at `(u, v)`, which are -1 and 1 at opposite sides of the quad; points outside have
    /// the colour of the nearest point of the quad.
    pub fn colour_at(&self, [u, v]: [f64; 2]) -> [f64; 3] {
        // Just below 1, so that the last field includes its far side.
        let inside = |x: f64| x.clamp(-1.0, 1.0 - 1e-9);
        let field = |x: f64| (0.5 * (x + 1.0) * self.fields as f64) as usize;
        let [column, row] = [u, v].map(|x| field(inside(x)));
        let bright = match self.pattern {
            Pattern::Checks => (column + row).is_multiple_of(2),
            Pattern::Stripes => column.is_multiple_of(2),
            Pattern::Frames => field(inside(2.0 * u.abs().max(v.abs()) - 1.0)).is_multiple_of(2),
        };
        if bright { self.colour } else { self.colour.map(|channel| DARK * channel) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the bright shade is at each place.
    fn bright(pattern: Pattern, fields: usize, places: &[[f64; 2]]) -> Vec<bool> {
        let texture = Texture { colour: [1.0, 0.5, 0.0], pattern, fields };
        places.iter().map(|&place| texture.colour_at(place)[0] == 1.0).collect()
    }

    #[test]
    fn patterns_alternate_as_they_say() {
        let quarters = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
        assert_eq!(bright(Pattern::Checks, 2, &quarters), [true, false, false, true]);
        assert_eq!(bright(Pattern::Stripes, 2, &quarters), [true, false, true, false]);
        let outwards = [[0.0, 0.0], [0.4, 0.0], [0.0, -0.6], [0.9, 0.9]];
        assert_eq!(bright(Pattern::Frames, 2, &outwards), [true, true, false, false]);
    }

    #[test]
    fn outside_is_painted_like_the_nearest_point() {
        let texture = Texture { colour: [0.2, 0.4, 0.8], pattern: Pattern::Checks, fields: 3 };
        assert_eq!(texture.colour_at([5.0, 0.0]), texture.colour_at([1.0, 0.0]));
        assert_eq!(texture.colour_at([-1e9, 1e9]), texture.colour_at([-1.0, 1.0]));
    }
}
