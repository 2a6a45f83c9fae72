//! Charts of speed against accuracy, per task and variant.

use softrast_cli::method_colour;
use softrast_lab::{
    mean,
    plot::{Axis, Plot, Series},
};

use crate::{Record, groups::by_variant};

/// The error of the returned step against seconds, for the methods of one task in one variant.
pub(crate) struct Chart {
    /// File name without its ending.
    pub(crate) name: String,
    pub(crate) caption: String,
    pub(crate) plot: Plot,
}

/// The charts in the order of [`by_variant`].
pub(crate) fn charts(records: &[Record]) -> Vec<Chart> {
    by_variant(records).iter().map(|group| chart(group)).collect()
}

fn chart(group: &[&Record]) -> Chart {
    let records: Vec<&Record> = group.iter().filter(|one| !one.varied).copied().collect();
    let point = |one: &&Record| [one.seconds, mean(&one.returned)];
    let points: Vec<[f64; 2]> = records.iter().map(point).collect();
    let best = front(&points);
    let series = records.iter().zip(&points).enumerate().map(|(k, (one, &point))| Series {
        name: one.method.clone(),
        colour: method_colour(&one.method),
        // A fixed width is filled, others are open.
        dashed: !one.method.ends_with(" static"),
        points: vec![point],
        marked: best.contains(&k),
        boxed: one.method == "preset",
        ..Series::default()
    });
    let (task, variant) = (group[0].task(), group[0].variant());
    let axes = Plot::new(
        Axis::logarithmic("seconds of a run (less is better)"),
        Axis::logarithmic(&format!("{} of the returned step", group[0].titles[0])),
    );
    Chart {
        name: format!("{}-{variant}-pareto", task.name),
        caption: format!(
            "{}, {variant}: error of the returned step against the seconds of a run, a mark for each method",
            task.title
        ),
        plot: Plot {
            series: series.collect(),
            front: best.iter().map(|&k| points[k]).collect(),
            ..axes
        },
    }
}

/// Indices of the points that no other one beats in both coordinates or in one at the same other, from left to right.
fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let beats = |a: &[f64; 2], b: &[f64; 2]| a != b && a[0] <= b[0] && a[1] <= b[1];
    let beaten = |k: &usize| points.iter().any(|other| beats(other, &points[*k]));
    let mut front: Vec<usize> = (0..points.len()).filter(|k| !beaten(k)).collect();
    front.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
    front
}

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [[1.0, 5.0], [2.0, 5.0], [3.0, 1.0], [0.5, 9.0], [3.0, 2.0], [1.0, 5.0]];
        assert_eq!(front(&points), [3, 0, 5, 2]);
    }
}
