//! Numbers as text.

/// A number with about four significant digits.
pub fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        1e-3..1.0 => format!("{x:.4}"),
        1.0..10.0 => format!("{x:.3}"),
        10.0..100.0 => format!("{x:.2}"),
        100.0..1e3 => format!("{x:.1}"),
        1e3..1e6 => format!("{x:.0}"),
        _ => format!("{x:.3e}"),
    }
}

/// [`short`], or `none`.
pub fn short_or_none(x: Option<f64>) -> String {
    x.map_or_else(|| "none".into(), short)
}

/// A number with all its digits and few zeros, as one would type it.
pub fn exact(x: f64) -> String {
    if (1e-3..1e6).contains(&x.abs()) || x == 0.0 { x.to_string() } else { format!("{x:e}") }
}

/// A count of a thing, such as `1 parameter` or `3 parameters`.
pub fn counted(n: usize, thing: &str) -> String {
    if n == 1 { format!("1 {thing}") } else { format!("{n} {thing}s") }
}

/// Least intersection over union at which a silhouette fits its mask.
pub const FITS: f64 = 0.95;

/// The fit of a silhouette with this intersection over union, in words: `fits`, `partly fits` or `does not fit`.
pub fn fit(iou: f64) -> &'static str {
    match iou {
        FITS.. => "fits",
        0.8.. => "partly fits",
        _ => "does not fit",
    }
}

/// A line for a terminal: a name and its text.
pub fn line(name: &str, text: &str) -> String {
    format!("  {name:<22} {text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_cut_to_about_four_digits() {
        let shown = [0.0, 0.012345, 1.23456, -12.3456, 123.456, 12345.6, 1e-9, 2.5e7].map(short);
        let expected = ["0", "0.0123", "1.235", "-12.35", "123.5", "12346", "1.000e-9", "2.500e7"];
        assert_eq!(shown, expected);
        assert_eq!([0.1, 1e-7, 250.0].map(exact), ["0.1", "1e-7", "250"]);
        assert_eq!([counted(1, "run"), counted(2, "run")], ["1 run", "2 runs"]);
    }
}
