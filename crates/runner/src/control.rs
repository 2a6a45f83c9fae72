use clap::{Args, Parser};

use crate::{
    Command, Error, Resolution, Schedule, Settings, SoftnessChoice,
    error::found,
    resolution::resolution,
    settings::{count, positive, share, softness},
};

/// Flags that say how to work, not what on: the task does not see them.
#[derive(Args, Clone, Debug)]
pub(crate) struct Control {
    /// Go on from what an interrupted `evaluate`, `search`, `choose` or `learn` has finished.
    #[arg(long)]
    pub(crate) resume: bool,

    /// Second method for `evaluate` to run on the same seeds; in quotes --scale, --scale-end,
    /// --schedule, --squared, --surrogate-scale, --learning-rate, --resolution and --tolerance may follow:
    /// "gauss --scale 0.01".
    #[arg(long, value_name = "NAME|FILE.json", value_parser = rival)]
    pub(crate) against: Option<Rival>,

    /// Training seeds, counted from 1000000, that `search` and `choose` try every setting on [default:
    /// 8, or what the task says].
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub(crate) search_runs: Option<usize>,

    /// Seconds that `choose`, or `--softness auto`, may take; no limit by default.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) budget: Option<f64>,

    /// Scales that `search` tries; each pair of a wider and a narrower one is a decay.
    #[arg(long, value_name = "X,X...", value_delimiter = ',', value_parser = positive)]
    pub(crate) scales: Vec<f64>,

    /// Learning rates that `search` tries.
    #[arg(long, value_name = "X,X...", value_delimiter = ',', value_parser = positive)]
    pub(crate) learning_rates: Vec<f64>,
}

/// A method to compare with, as one word of the command line names it.
#[derive(Clone, Debug, Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
pub(crate) struct Rival {
    #[arg(value_parser = softness)]
    softness: SoftnessChoice,
    #[arg(long, value_parser = positive, allow_negative_numbers = true)]
    scale: Option<f64>,
    #[arg(long, value_parser = positive, allow_negative_numbers = true)]
    scale_end: Option<f64>,
    #[arg(long, value_enum)]
    schedule: Option<Schedule>,
    #[arg(long)]
    squared: bool,
    #[arg(long, value_parser = positive, allow_negative_numbers = true)]
    surrogate_scale: Option<f64>,
    #[arg(long, value_parser = positive, allow_negative_numbers = true)]
    learning_rate: Option<f64>,
    #[arg(long, value_parser = resolution)]
    resolution: Option<Resolution>,
    #[arg(long, value_parser = share)]
    tolerance: Option<f64>,
}

impl Rival {
    /// The settings of the first method with this one in its place.
    ///
    /// Its scales are its own or the task's, never those of the first method, whose scale may mean
    /// another width; its learning rate, resolution and tolerance are its own or those of the first.
    ///
    /// # Errors
    ///
    /// If its flags contradict each other.
    pub(crate) fn settings(&self, first: &Settings) -> Result<Settings, Error> {
        let mut settings = Settings {
            softness: Some(self.softness.clone()),
            scale: self.scale,
            scale_end: self.scale_end,
            schedule: self.schedule,
            squared: self.squared,
            surrogate_scale: self.surrogate_scale,
            learning_rate: self.learning_rate.or(first.learning_rate),
            resolution: self.resolution.or(first.resolution),
            tolerance: self.tolerance.or(first.tolerance),
            ..first.clone()
        };
        settings.reconcile(Command::Evaluate)?;
        Ok(settings)
    }
}

impl Control {
    /// Refuses flags that mean nothing to the command.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] that names the flag.
    pub(crate) fn check(&self, command: Command) -> Result<(), Error> {
        let given = [
            (
                self.resume,
                "--resume",
                &[Command::Evaluate, Command::Search, Command::Choose, Command::Learn][..],
            ),
            (self.against.is_some(), "--against", &[Command::Evaluate]),
            (self.search_runs.is_some(), "--search-runs", &[Command::Search, Command::Choose]),
            (self.budget.is_some(), "--budget", &[Command::Choose, Command::Solve]),
            (!self.scales.is_empty(), "--scales", &[Command::Search]),
            (!self.learning_rates.is_empty(), "--learning-rates", &[Command::Search]),
        ];
        match given.into_iter().find(|(given, _, of)| *given && !of.contains(&command)) {
            None => Ok(()),
            Some((_, flag, of)) => {
                let of: Vec<&str> = of.iter().map(|command| command.name()).collect();
                let (of, command) = (of.join(" and "), command.name());
                Err(Error::Usage(format!("{flag} goes with {of}, not with {command}")))
            }
        }
    }
}

fn rival(text: &str) -> Result<Rival, String> {
    // The name of a file may hold spaces.
    let words: Vec<&str> = match softness(text) {
        Ok(_) => vec![text],
        Err(_) => text.split_whitespace().collect(),
    };
    Rival::try_parse_from(words).map_err(|error| found(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: Settings,
    }

    #[test]
    fn a_rival_has_its_own_scales_and_shares_the_rest() {
        let first = Line::parse_from([
            "task",
            "--scale",
            "0.1",
            "--surrogate-scale",
            "1",
            "--learning-rate",
            "0.3",
        ])
        .settings;
        let second = rival("gauss").unwrap().settings(&first).unwrap();
        assert_eq!(second.softness, Some(SoftnessChoice::Named("gauss")));
        assert_eq!((second.scale, second.learning_rate), (None, Some(0.3)));
        assert_eq!(second.surrogate_scale, None);
        let second = rival("mlp --scale-end 1e-3 --learning-rate 2").unwrap();
        let second = second.settings(&first).unwrap();
        assert_eq!((second.scale_end, second.learning_rate), (Some(1e-3), Some(2.0)));
        assert_eq!(second.schedule, Some(Schedule::Decay));
    }

    #[test]
    fn a_rival_that_makes_no_sense_is_refused_in_a_line() {
        assert!(rival("my softness.json").is_ok());
        for wrong in ["", "sofft", "gauss --scale 0", "gauss --steps 3", "gauss exp"] {
            let message = rival(wrong).err().unwrap_or_else(|| panic!("{wrong}"));
            assert_eq!(message.lines().count(), 1, "{message}");
        }
        let first = Line::parse_from(["task"]).settings;
        let twisted = rival("gauss --schedule static --scale-end 1e-3").unwrap();
        assert!(twisted.settings(&first).is_err());
    }
}
