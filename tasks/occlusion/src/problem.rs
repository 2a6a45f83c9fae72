use softrast_cli::Variant;

/// Parameters of all instances of a variant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Problem {
    /// Quads of an instance, at least one.
    pub quads: usize,
    /// Smallest and largest depth that targets and starts are drawn from; smaller is nearer.
    pub depths: [f64; 2],
    /// Whether only the front quad is to be found, instead of the order of all.
    pub front_only: bool,
}

/// Allowed excess of depths beyond the range they are drawn from, in units of that range.
const ROOM: f64 = 0.5;
/// Distance of the planes from the allowed depths, in the same unit.
const MARGIN: f64 = 0.02;

impl Problem {
    /// Three quads, whose order is to be found.
    ///
    /// Source: Wu et al. 2024, Sec. 5.1; docs/notes.md, Occlusion.
    pub const ORIGINAL: Self = Self { quads: 3, depths: [0.5, 1.5], front_only: false };

    /// Eight quads, of which the front one is to be found.
    ///
    /// Source: Wu et al. 2024, Sec. 5.1; docs/notes.md, Occlusion.
    pub const TRANSFER: Self = Self { quads: 8, depths: [-1.5, 2.0], front_only: true };

    /// The problem of a variant.
    pub fn of(variant: Variant) -> Self {
        match variant {
            Variant::Original => Self::ORIGINAL,
            Variant::Transfer => Self::TRANSFER,
        }
    }

    /// Smallest and largest depth that the search may reach: half the range of depths on either
    /// side of it.
    pub fn room(&self) -> [f64; 2] {
        self.widened(ROOM)
    }

    /// Depth of the near and of the far plane, between which depths are measured: slightly outside
    /// the room, so that no quad is on a plane, where some softnesses have a kink.
    pub fn planes(&self) -> [f64; 2] {
        self.widened(ROOM + MARGIN)
    }

    fn widened(&self, by: f64) -> [f64; 2] {
        let [least, largest] = self.depths;
        let more = by * (largest - least);
        [least - more, largest + more]
    }
}
