//! The command line of a fuzz target.

use std::{path::PathBuf, time::Duration};

/// Limits of a run, its seed, and the folder for findings.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Seed of all inputs.
    pub seed: u64,
    /// Inputs per reader.
    pub inputs: u64,
    /// Total time of all readers, in equal shares; a reader ends at its last input or its time limit, whichever is first.
    pub time: Duration,
    /// The folder for inputs with findings.
    pub keep: PathBuf,
    /// Prefix of the names of the readers to run.
    pub only: String,
}

impl Settings {
    const USAGE: &'static str = "[--seed N] [--inputs N] [--seconds N] [--keep DIR] [--only NAME]: a number after each of the first three";

    /// Parses `words`, the arguments of the program without its name.
    ///
    /// Defaults: seed 1, 100,000 inputs, an hour, `out/fuzz`, all readers.
    ///
    /// # Errors
    ///
    /// If a word is not an option, or its value is missing or not a number; a message of one line.
    pub fn parse(words: impl IntoIterator<Item = String>) -> Result<Self, String> {
        let mut settings = Self {
            seed: 1,
            inputs: 100_000,
            time: Duration::from_secs(3600),
            keep: PathBuf::from("out/fuzz"),
            only: String::new(),
        };
        let mut words = words.into_iter();
        while let Some(word) = words.next() {
            let usage = || format!("{word}: {}", Self::USAGE);
            let value = words.next().ok_or_else(usage)?;
            let number = || value.parse().map_err(|_| usage());
            match word.as_str() {
                "--seed" => settings.seed = number()?,
                "--inputs" => settings.inputs = number()?,
                "--seconds" => settings.time = Duration::from_secs(number()?),
                "--keep" => settings.keep = value.into(),
                "--only" => settings.only = value,
                _ => return Err(usage()),
            }
        }
        Ok(settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(words: &str) -> Result<Settings, String> {
        Settings::parse(words.split_whitespace().map(str::to_owned))
    }

    #[test]
    fn options_may_be_left_out_and_wrong_ones_are_one_line() {
        let found = parse("--seconds 7 --keep a/b --seed 3").unwrap();
        assert_eq!((found.seed, found.inputs, found.time.as_secs()), (3, 100_000, 7));
        assert_eq!(found.keep, PathBuf::from("a/b"));
        for wrong in ["--seed", "--inputs x", "--inputs -1", "--what 1", "7"] {
            let message = parse(wrong).unwrap_err();
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}
