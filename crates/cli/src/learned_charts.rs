//! Charts of a learned softness.

use softrast_inverse::{PhiLayout, ScheduledSoftness};
use softrast_lab::plot::{Axis, Plot, Series};
use softrast_raster::HostBackend;
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{numbers, tensor, vector};

/// The learned softness next to that of the start, and the schedule of its scale: charts and captions.
pub(crate) fn learned_charts(
    layout: &PhiLayout,
    learned: &ScheduledSoftness,
) -> Vec<(Plot, &'static str)> {
    let start = layout.softness(&layout.start()).0;
    let (size, pixels) = (layout.size(), layout.size() as f64 / 2.0);
    let at: &[(&str, f64)] = match learned.schedule {
        None => &[("", 0.0)],
        Some(_) => &[(", first step", 0.0), (", last step", 1.0)],
    };
    let both = [("start", &start), ("learned", learned)];
    let mut steps = Vec::new();
    for (name, softness) in both {
        for (when, progress) in at {
            let phi = softness.phi_at(*progress, size);
            steps.push((format!("{name}{when}"), softness.softness, phi));
            let surrogate = softness.surrogate_at(*progress, size);
            steps
                .extend(surrogate.map(|s| (format!("{name}{when}, surrogate"), s.softness, s.phi)));
        }
    }
    let farthest = steps.iter().map(|(_, softness, phi)| reach(*softness, phi)).fold(0.0, f64::max);
    let series = steps.into_iter().map(|(name, softness, phi)| Series {
        name,
        points: curve(softness, &phi, farthest, pixels),
        ..Series::default()
    });
    let axes = Plot::new(Axis::linear("signed distance (pixels)"), Axis::linear("coverage"));
    let mut charts = vec![(
        Plot { series: series.collect(), ..axes },
        "The softness: coverage over the signed distance from an edge, positive inside. Where it has a surrogate, that is what the \
         gradient is taken of.",
    )];
    if learned.schedule.is_some() {
        let series = both.map(|(name, softness)| {
            let squared = softness.softness.scale_is_squared();
            let width = |scale: f64| pixels * if squared { scale.sqrt() } else { scale };
            let scale =
                |step: usize| [step as f64, width(softness.scale_at(layout.progress(step), size))];
            let points = (0..layout.steps().max(1)).map(scale).collect();
            Series { name: name.into(), points, ..Series::default() }
        });
        let name = if learned.softness.scale_is_squared() { "root of the scale" } else { "scale" };
        let scale = Axis::logarithmic(&format!("{name} (pixels)"));
        let (along, caption) = match learned.adaptive {
            None => ("inner step", "The scale of the softness over the inner steps."),
            Some(_) => (
                "progress along the schedule (steps at constant pace)",
                "The scale of the softness along its schedule. The error of a run determines its progress.",
            ),
        };
        let chart = Plot { series: series.into(), ..Plot::new(Axis::linear(along), scale) };
        charts.push((chart, caption));
    }
    charts
}

/// Distance from the edge up to which a softness is above a hundredth, in NDC.
fn reach(softness: EdgeSoftness, phi: &[f64]) -> f64 {
    let places: Vec<f64> = (0..60).map(|k| 1e-4 * 1.2f64.powi(k)).collect();
    let value = values(softness, phi, places.iter().map(|d| -d).collect());
    let last = value.iter().rposition(|&s| s > 0.01).map_or(1e-4, |k| places[k]);
    last.min(1.0)
}

/// Points of a softness over the distance in pixels.
fn curve(softness: EdgeSoftness, phi: &[f64], reach: f64, pixels: f64) -> Vec<[f64; 2]> {
    const HALF: i32 = 150;
    let place = |k: i32| 1.3 * reach * f64::from(k) / f64::from(HALF);
    let places: Vec<f64> = (-HALF..=HALF).map(place).collect();
    let value = values(softness, phi, places.clone());
    places.into_iter().zip(value).map(|(d, s)| [d * pixels, s]).collect()
}

fn values(softness: EdgeSoftness, phi: &[f64], places: Vec<f64>) -> Vec<f64> {
    let count = places.len();
    numbers(softness.value(vector::<HostBackend>(phi), tensor(places, [count])))
}
