//! The soft steps themselves, side by side (Fig. 3 of the paper).

use std::path::Path;

use softrast_method::{numbers, shipped, tensor};
use softrast_raster::HostBackend;
use softrast_runner::method_colour;
use softrast_softness::{EdgeSoftness, Family, ScheduledSoftness, Softness};

use crate::{
    Measured,
    charts::Chart,
    plot::{Axis, Plot, Series},
};

/// Farthest distance from the edge that is shown, in pixels, and points on either side.
const REACH_PX: f64 = 1.0;
const HALF: i32 = 120;

/// What each method of one task takes for the step at an edge, at the last step of a run.
///
/// None where no method is a family or a file that can be read.
pub(crate) fn chart(cells: &[&Measured]) -> Option<Chart> {
    let first = cells.first()?;
    let pixels = first.size as f64 / 2.0;
    let offsets: Vec<f64> =
        (-HALF..=HALF).map(|k| REACH_PX * f64::from(k) / f64::from(HALF)).collect();
    let distances: Vec<f64> = offsets.iter().map(|offset| offset / pixels).collect();
    let series = cells.iter().filter_map(|one| {
        let (softness, phi) = at_the_end(one)?;
        let phi = tensor::<HostBackend, 1>(phi.clone(), [phi.len()]);
        let at = tensor(distances.clone(), [distances.len()]);
        let covered = numbers(softness.value(phi, at));
        let name = one.cell.method_name();
        Some(Series {
            colour: method_colour(&name),
            dashed: one.moves(),
            points: offsets.iter().zip(covered).map(|(&x, y)| [x, y]).collect(),
            name,
            ..Series::default()
        })
    });
    let series: Vec<Series> = series.collect();
    (!series.is_empty()).then(|| Chart {
        name: format!("{}-{}-functions", first.cell.task.name(), first.cell.variant),
        caption: format!(
            "{}, {}: how much a face covers a pixel by its distance from the nearest edge, inside \
             being positive, with the parameters of the last step. What was searched for and what was \
             learned are drawn alike.",
            first.cell.task.title(),
            first.cell.variant
        ),
        plot: Plot {
            x: Axis::linear("signed distance (pixels)"),
            y: Axis::linear("coverage"),
            series,
            front: Vec::new(),
        },
    })
}

/// Softness and parameters at the last step.
fn at_the_end(one: &Measured) -> Option<(EdgeSoftness, Vec<f64>)> {
    let name = one.cell.softness();
    if let Ok(family) = name.parse::<Family>()
        && family != Family::Mlp
    {
        let softness = EdgeSoftness { family, squared: one.squared };
        return Some((softness, softness.default_phi(one.scale_end?)));
    }
    let file = match name {
        name if one.cell.is_shipped() => {
            let task = one.cell.task.name();
            let called = match name.strip_prefix("learned-") {
                Some(kind) => shipped::called(task, kind),
                None => task.to_owned(),
            };
            shipped::softness(&called).ok()??
        }
        file => ScheduledSoftness::load(Path::new(file)).ok()?,
    };
    let ScheduledSoftness { softness, phi, schedule, .. } = file;
    if schedule.is_none() {
        return Some((softness, phi));
    }
    let phi = tensor::<HostBackend, 1>(phi.clone(), [phi.len()]);
    let scale = tensor(vec![one.scale_end?], [1]);
    Some((softness, numbers(softness.with_scale(phi, scale))))
}
