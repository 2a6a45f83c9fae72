use super::frame::{escape, page, warnings};
use crate::{heat_map, search_summary::SearchSummary, summary::short};

/// The page of a search that was stopped before its best setting was scored.
pub(crate) fn of_search(title: &str, about: &str, found: &SearchSummary, command: &str) -> String {
    let partial = found.partial.map(|partial| {
        format!("Stopped: {}; --resume goes on from them", partial.says("settings"))
    });
    let partial: Vec<String> = partial.into_iter().collect();
    let body = format!("{}{}", warnings(&partial), section(found));
    let beside = "<code>search.json</code> and <code>search.csv</code> hold every setting tried";
    page(title, about, &body, command, beside)
}

/// What was tried and what is best.
pub(super) fn section(found: &SearchSummary) -> String {
    let (head, score) = (escape(&found.head()), escape(found.score.name));
    let (flags, criterion) = (escape(&found.best.flags), escape(found.criterion));
    let mean = found.best.cell.mean.map_or_else(|| "none".into(), short);
    let held_out = found.held_out.as_ref().map_or_else(String::new, |scored| {
        let [low, high] = scored.ci95.map(short);
        format!(
            " On the {} seeds from {} on, which the search never saw, it is {} (95 % interval {low} \
             to {high}); all results below are of these.",
            scored.runs,
            scored.seed,
            short(scored.mean)
        )
    });
    let map = heat_map::svg(&found.cells);
    format!(
        "<h2>Search</h2>
<p>{head}. The best setting:</p>
<pre>{flags}</pre>
<p>Its {score} is {mean} on the training seeds.{held_out}</p>
<figure>
{map}<figcaption>Mean {score} on the training seeds at the last step, the lower (darker) the better; the
frame marks the best. Two scales with an arrow are a decay from the one to the other. A star marks
settings with runs whose numbers did not stay finite; white is what was not tried.</figcaption>
</figure>
<p class=\"note\">The best setting has the {criterion}.</p>
"
    )
}
