//! Medians of measurements, and the page that shows them.

use std::{cell::RefCell, collections::BTreeMap, error::Error, fs, path::Path, time::Duration};

const START: &str = "<!-- what follows is written by the benchmark profile_sum -->\n";
const END: &str = "<!-- end of what the benchmark writes -->";

/// Times of one row of the page by column, in milliseconds.
#[derive(Default)]
struct Row {
    pairs: usize,
    times: BTreeMap<&'static str, Vec<f64>>,
}

/// All rows in the order of their first time.
#[derive(Default)]
pub(crate) struct Record {
    rows: RefCell<Vec<(String, Row)>>,
}

impl Record {
    /// Records the mean time of some iterations.
    pub(crate) fn note(
        &self,
        row: &str,
        pairs: usize,
        column: &'static str,
        total: Duration,
        iterations: u64,
    ) {
        let mut rows = self.rows.borrow_mut();
        let at = rows.iter().position(|(name, _)| name == row).unwrap_or_else(|| {
            rows.push((row.to_owned(), Row { pairs, ..Row::default() }));
            rows.len() - 1
        });
        let ms = total.as_secs_f64() * 1e3 / iterations as f64;
        rows[at].1.times.entry(column).or_default().push(ms);
    }

    /// The median of a cell, if it was measured.
    pub(crate) fn median(&self, row: &str, column: &str) -> Option<f64> {
        let rows = self.rows.borrow();
        let (_, row) = rows.iter().find(|(name, _)| name == row)?;
        let mut times = row.times.get(column)?.clone();
        times.sort_by(f64::total_cmp);
        Some(times[times.len() / 2])
    }

    /// Rows by name, with their pairs.
    pub(crate) fn rows(&self) -> Vec<(String, usize)> {
        self.rows.borrow().iter().map(|(name, row)| (name.clone(), row.pairs)).collect()
    }
}

/// Puts `text` into the page between its two marks.
pub(crate) fn write(page: &Path, text: &str) -> Result<(), Box<dyn Error>> {
    let old = fs::read_to_string(page)?;
    let (before, rest) = old.split_once(START).ok_or("the page has no mark for the start")?;
    let (_, after) = rest.split_once(END).ok_or("the page has no mark for the end")?;
    Ok(fs::write(page, format!("{before}{START}{text}{END}{after}"))?)
}
