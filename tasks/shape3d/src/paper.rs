use softrast_cli::Paper;

/// Source: Wu et al. 2024, Tables 2 and 3. Its row of the logistic has no label.
pub(crate) const PAPER: Paper = Paper {
    freedom: ["3840; 1926 coordinates and a centre here"; 2],
    runs: [5, 1],
    note: "Paper's unit: 100 times the hard IoU loss in the original, 1000 times in the transfer, as its figures suggest.\nIts Chamfer \
           distance has neither definition nor scale; ours is the mean squared distance to the nearest of 10,000\npoints spread by \
           area, both directions averaged, times 1000.",
    table3: &[
        ("mlp", [[19.4, 3.2], [69.0, 4.72]]),
        ("gauss", [[31.2, 11.9], [79.0, 4.49]]),
        ("logistic", [[29.8, 10.1], [97.0, 4.54]]),
        ("exp", [[32.0, 11.3], [87.0, 4.35]]),
        ("gamma", [[28.7, 10.0], [86.0, 4.58]]),
    ],
    in_its_unit: |ours| {
        let factor = if ours.original { 100.0 } else { 1000.0 };
        [Some(factor * ours.hard), ours.parameters.first().copied()]
    },
};
