/// Numbers of Wu et al. 2024 for a task, for comparisons.
#[derive(Clone, Copy, Debug)]
pub struct Paper {
    /// Degrees of freedom in Table 2, original and transfer.
    pub freedom: [&'static str; 2],
    /// Seeds of a full and of a quick comparison.
    pub runs: [u32; 2],
    /// Its unit as far as it is known, and the differences of its task to ours.
    pub note: &'static str,
    /// Image and parameter error of a method in Table 3, original and transfer; NaN if not printed.
    pub table3: &'static [(&'static str, [[f64; 2]; 2])],
    /// Our errors in the unit of Table 3: image and parameter error of a variant.
    pub in_its_unit: fn(&InOurUnits) -> [Option<f64>; 2],
}

/// Mean errors of runs, as in our results.
#[derive(Clone, Debug)]
pub struct InOurUnits {
    /// Whether it is the original variant.
    pub original: bool,
    /// Error of the hard image.
    pub hard: f64,
    /// Error of the soft image.
    pub soft: f64,
    /// Error of the parameters, and the further errors of the task in their order.
    pub parameters: Vec<f64>,
    /// Faces of the scene.
    pub faces: usize,
}

impl Paper {
    /// The entry of a task that the paper does not have.
    pub const NONE: Self = Self {
        freedom: ["not in the paper"; 2],
        runs: [20, 5],
        note: "Not in the paper.",
        table3: &[],
        in_its_unit: |_| [None; 2],
    };

    /// Numbers of Table 3 for a method.
    pub fn printed(&self, method: &str, original: bool) -> Option<[Option<f64>; 2]> {
        let (_, rows) = self.table3.iter().find(|(name, _)| *name == method)?;
        let row = rows[usize::from(!original)];
        Some(row.map(|error| (!error.is_nan()).then_some(error)))
    }
}
