use softrast_cli::Paper;

/// Source: Wu et al. 2024, Tables 2 and 3. Its row of the logistic has no label.
pub(crate) const PAPER: Paper = Paper {
    freedom: ["3", "8"],
    runs: [50, 5],
    note: "Paper's unit: the mean squared error of the soft image, and, as we guess, the number of pairs in the wrong order.\nThe \
           released blending depends on the order of faces; ours is Eq. 4 with exact derivatives. The transfer scores the\nfront quad \
           only. The paper's rows Exp and Gamma are identical: their weights are 1 at every depth.",
    table3: &[
        ("mlp", [[0.041, 0.244], [0.040, 1.63]]),
        ("gauss", [[0.049, 0.962], [0.058, 7.63]]),
        ("logistic", [[0.048, 0.916], [0.055, 7.51]]),
        ("exp", [[0.049, 0.627], [0.046, 1.40]]),
        ("gamma", [[0.049, 0.627], [0.046, 1.40]]),
    ],
    in_its_unit: |ours| {
        let pairs = ours.faces as f64 * (ours.faces as f64 - 1.0) / 2.0;
        [Some(ours.soft), ours.parameters.first().map(|wrong| wrong * pairs)]
    },
};
