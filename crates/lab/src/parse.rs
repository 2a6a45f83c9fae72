//! Parsers of flags: one for each kind of number, and one for names.

use serde::{
    Deserialize,
    de::{IntoDeserializer, value::Error},
};

/// A positive, finite number.
///
/// # Errors
///
/// The expected form.
pub fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&x: &f64| x > 0.0 && x.is_finite());
    number.ok_or_else(|| "expected a positive number".into())
}

/// A number above 0 and below 1.
///
/// # Errors
///
/// The expected form.
pub fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|&x: &f64| x > 0.0 && x < 1.0);
    share.ok_or_else(|| "expected a number above 0 and below 1".into())
}

/// A whole number from `LOW` to `HIGH`.
///
/// # Errors
///
/// The expected form.
pub fn whole<const LOW: usize, const HIGH: usize>(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|n| (LOW..=HIGH).contains(n));
    number.ok_or_else(|| format!("expected a whole number from {LOW} to {HIGH}"))
}

/// A number of steps or runs, at most a million: more are probably a typing error.
///
/// # Errors
///
/// The expected form.
pub fn count(text: &str) -> Result<usize, String> {
    whole::<1, 1_000_000>(text)
}

/// A seed.
///
/// # Errors
///
/// The expected form.
pub fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "expected a whole number from 0".into())
}

/// The variant of an enum by its name in the results.
///
/// # Errors
///
/// The list of names.
pub fn named<T: for<'de> Deserialize<'de>>(text: &str) -> Result<T, String> {
    T::deserialize(text.into_deserializer()).map_err(|error: Error| error.to_string())
}
