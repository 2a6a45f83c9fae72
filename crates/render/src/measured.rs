/// What drawing a scene gave and took. Times are medians, in milliseconds.
#[derive(Debug)]
pub(crate) struct Measured {
    /// `[views, size, size]`, top row first.
    pub(crate) alpha: Vec<f64>,
    /// Mean squared difference to the target, and the norm of its gradient to the vertices.
    pub(crate) loss: Option<[f64; 2]>,
    /// Pixel-face pairs that each pass visits.
    pub(crate) pairs: usize,
    /// Share of the pairs which the default tolerance keeps that this one culls; `None` for the
    /// reference, which culls none.
    pub(crate) culled: Option<f64>,
    /// From world vertices to coverage.
    pub(crate) forward_ms: f64,
    /// From coverage to the loss and its gradient to the world vertices.
    pub(crate) backward_ms: Option<f64>,
    /// Of both together.
    pub(crate) total_ms: f64,
    /// The profile in use; `None` for the reference, which evaluates the softness itself.
    pub(crate) profile: Option<Knots>,
}

/// The table of a profile.
#[derive(Debug)]
pub(crate) struct Knots {
    pub(crate) count: usize,
    /// Distances outside and inside, in NDC, beyond which it is constant.
    pub(crate) support_ndc: [f64; 2],
    /// Choosing the knots and filling the table, which is done once for a softness.
    pub(crate) prepare_ms: f64,
}
