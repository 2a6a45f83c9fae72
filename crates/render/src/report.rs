use serde::Serialize;
use softrast_raster::Rasterizer;
use softrast_runner::peak_rss_mib;

use crate::{args::Args, measured::Measured, scene::Scene};

/// The results as printed; the names of the fields are those in JSON.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    mesh: String,
    faces: usize,
    views: usize,
    size: usize,
    softness: String,
    squared: bool,
    phi: Vec<f64>,
    t_conorm: String,
    tolerance: f64,
    backend: &'static str,
    threads: usize,
    repeat: usize,
    pairs: usize,
    /// Share of the pairs which the default tolerance keeps that are left out.
    culled_by_tolerance: Option<f64>,
    mean_alpha: f64,
    loss: Option<f64>,
    gradient_norm: Option<f64>,
    forward_ms: f64,
    backward_ms: Option<f64>,
    total_ms: f64,
    prepare_ms: Option<f64>,
    base_rss_mib: Option<f64>,
    peak_rss_mib: Option<f64>,
    profile_knots: Option<usize>,
    /// Outside and inside.
    support_ndc: Option<[f64; 2]>,
    out: String,
}

/// How a measurement was made.
pub(crate) struct Setting {
    pub(crate) backend: &'static str,
    pub(crate) repeat: usize,
    /// Most memory held before drawing.
    pub(crate) base_rss_mib: Option<f64>,
}

impl Report {
    pub(crate) fn new(args: &Args, scene: &Scene, setting: &Setting, measured: &Measured) -> Self {
        let &Measured { pairs, forward_ms, backward_ms, total_ms, .. } = measured;
        let profile = measured.profile.as_ref();
        Self {
            mesh: args.mesh.display().to_string(),
            faces: scene.faces.len(),
            views: scene.views(),
            size: scene.size,
            softness: scene.softness.family.to_string(),
            squared: scene.softness.squared,
            phi: scene.phi.clone(),
            t_conorm: scene.t_conorm.to_string(),
            tolerance: scene.tolerance,
            backend: setting.backend,
            threads: rayon::current_num_threads(),
            repeat: setting.repeat,
            pairs,
            culled_by_tolerance: measured.culled,
            mean_alpha: measured.alpha.iter().sum::<f64>() / measured.alpha.len() as f64,
            loss: measured.loss.map(|[loss, _]| loss),
            gradient_norm: measured.loss.map(|[_, norm]| norm),
            forward_ms,
            backward_ms,
            total_ms,
            prepare_ms: profile.map(|knots| knots.prepare_ms),
            base_rss_mib: setting.base_rss_mib,
            peak_rss_mib: peak_rss_mib(),
            profile_knots: profile.map(|knots| knots.count),
            support_ndc: profile.map(|knots| knots.support_ndc),
            out: args.out.display().to_string(),
        }
    }

    /// That the tolerance leaves out most of what counts, if it does.
    ///
    /// Pairs that the default tolerance keeps still pull on their face: without them, gradients are
    /// off by as much.
    pub(crate) fn warning(&self) -> Option<String> {
        let culled = self.culled_by_tolerance.filter(|&culled| culled > 0.5)?;
        Some(format!(
            "--tolerance {} culls {:.0} % of the pairs that the default {:e} keeps: faces get no gradient \
             from pixels that they still cover a little; try a smaller one",
            self.tolerance,
            100.0 * culled,
            Rasterizer::TOLERANCE
        ))
    }

    /// A table for people.
    pub(crate) fn text(&self) -> String {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        let squared = if self.squared { " of the squared distance" } else { "" };
        let dense = self.views * self.size * self.size * self.faces;
        let share = 100.0 * self.pairs as f64 / dense as f64;
        let mut lines = vec![
            ("mesh", format!("{}, {} faces", self.mesh, self.faces)),
            (
                "image",
                format!("{} view{} of {2} x {2} pixels", self.views, plural(self.views), self.size),
            ),
            ("softness", format!("{}{squared}, joined by {}", self.softness, self.t_conorm)),
        ];
        if let (Some(knots), Some([outer, inner])) = (self.profile_knots, self.support_ndc) {
            let pixels = |ndc: f64| ndc * self.size as f64 / 2.0;
            let (outer, inner) = (pixels(outer), pixels(inner));
            lines.push((
                "profile",
                format!("{knots} knots, {outer:.2} px outside to {inner:.2} px inside an edge"),
            ));
        }
        lines.push(("pairs", format!("{} visited, {share:.3} % of all", self.pairs)));
        lines.push(("mean alpha", format!("{:.7}", self.mean_alpha)));
        if let (Some(loss), Some(norm)) = (self.loss, self.gradient_norm) {
            lines.push(("loss", format!("{loss:.7}, gradient norm {norm:.7}")));
        }
        let time = match self.backward_ms {
            Some(backward) => format!(
                "{:.3} ms forward + {backward:.3} ms backward = {:.3} ms",
                self.forward_ms, self.total_ms
            ),
            None => format!("{:.3} ms forward", self.forward_ms),
        };
        let (runs, threads) = (self.repeat, self.threads);
        lines.push((
            "time",
            format!(
                "{time} (median of {runs}), {} on {threads} thread{}",
                self.backend,
                plural(threads)
            ),
        ));
        if let (Some(peak), Some(base)) = (self.peak_rss_mib, self.base_rss_mib) {
            let grown = peak - base;
            lines.push(("memory", format!("{peak:.1} MiB at most, {grown:.1} for drawing")));
        }
        lines.push(("picture", self.out.clone()));
        let lines = lines.into_iter().map(|(name, value)| format!("{name:<12}{value}"));
        lines.collect::<Vec<_>>().join("\n")
    }
}
