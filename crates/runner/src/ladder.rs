use crate::{
    Detail, Init, Resolution, Schedule, Settings, SoftnessChoice, space::exact, usual_tolerance,
};

/// Methods from the least complex one on: parameters of the family first, then whether the scale
/// moves.
///
/// Source: Wu et al. 2024, Table 1, for the numbers of parameters.
const METHODS: [(&str, Schedule); 10] = [
    ("logistic", Schedule::Static),
    ("gauss", Schedule::Static),
    ("logistic", Schedule::Decay),
    ("gauss", Schedule::Decay),
    ("exp", Schedule::Static),
    ("exp", Schedule::Decay),
    ("gamma", Schedule::Static),
    ("gamma", Schedule::Decay),
    ("mlp", Schedule::Static),
    ("mlp", Schedule::Decay),
];

/// Images are not tried below this many pixels a side.
const FEWEST: usize = 8;

/// Largest errors of a pixel, the last being what tasks take if nobody says otherwise.
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// One answer to a question of `choose`.
#[derive(Clone, Debug)]
pub(crate) struct Rung {
    /// The flags that give it.
    pub(crate) flags: String,
    pub(crate) settings: Settings,
    /// What it is to compute, as far as that is known before it is prepared.
    pub(crate) with: With,
    /// Whether the settings that the question started from mean the same.
    pub(crate) usual: bool,
}

/// What an answer makes more or less of.
#[derive(Clone, Debug)]
pub(crate) enum With {
    /// Parameters of the softness, and so many more.
    Parameters(usize),
    /// Faces of the scene.
    Faces,
    /// In words.
    Words(String),
}

/// The softness families and how their scale moves, at the scales of the task.
pub(crate) fn methods(settings: &Settings) -> Vec<Rung> {
    let rung = |(softness, schedule)| {
        let (name, ends) = match schedule {
            Schedule::Static => ("static", 0),
            Schedule::Decay => ("decay", 1),
        };
        // A random start reaches the whole image, and takes over twenty times as long as a logistic.
        let init = (softness == "mlp").then_some(Init::Fitted);
        let from = if init.is_some() { " --init fitted" } else { "" };
        Rung {
            flags: format!("--softness {softness}{from} --schedule {name}"),
            settings: Settings {
                softness: Some(SoftnessChoice::Named(softness)),
                schedule: Some(schedule),
                init,
                scale: None,
                scale_end: None,
                ..settings.clone()
            },
            with: With::Parameters(ends),
            usual: false,
        }
    };
    METHODS.into_iter().map(rung).collect()
}

/// Resolutions of images of `size`, the fewest pixels first; none if one was asked for.
///
/// Where the scale moves, so may the resolution.
pub(crate) fn resolutions(settings: &Settings, size: usize) -> Vec<Rung> {
    if settings.resolution.is_some() {
        return Vec::new();
    }
    let smaller: Vec<usize> =
        Resolution::sides(size).skip(1).take_while(|&side| side >= FEWEST).collect();
    let auto = (moves(settings) && !smaller.is_empty()).then_some(Resolution::Auto);
    let smaller = smaller.into_iter().rev().map(Resolution::Side);
    let all = smaller.chain(auto).chain([Resolution::Full]).map(|resolution| Rung {
        flags: format!("--resolution {resolution}"),
        settings: Settings { resolution: Some(resolution), ..settings.clone() },
        with: With::Words(match resolution {
            Resolution::Full => format!("{size} pixels a side"),
            Resolution::Auto => format!("at most {size} pixels a side"),
            Resolution::Side(side) => format!("{side} pixels a side"),
        }),
        usual: resolution == Resolution::Full,
    });
    all.collect()
}

fn moves(settings: &Settings) -> bool {
    settings.schedule == Some(Schedule::Decay)
}

/// Tolerances of culling, the largest first; none if one was asked for.
pub(crate) fn tolerances(settings: &Settings) -> Vec<Rung> {
    if settings.tolerance.is_some() {
        return Vec::new();
    }
    let rung = |tolerance: f64| Rung {
        flags: format!("--tolerance {}", exact(tolerance)),
        settings: Settings { tolerance: Some(tolerance), ..settings.clone() },
        with: With::Words(format!("pixels off by {tolerance:e}")),
        usual: tolerance == usual_tolerance(moves(settings)),
    };
    TOLERANCES.into_iter().map(rung).collect()
}

/// Details of the task's mesh, the coarsest first; none if it has none to choose.
pub(crate) fn details(settings: &Settings, detail: Option<Detail>) -> Vec<Rung> {
    let Some(Detail { flag, values, usual }) = detail else {
        return Vec::new();
    };
    let rung = |value: usize| Rung {
        flags: format!("--{flag} {value}"),
        settings: Settings { detail: Some(value), ..settings.clone() },
        with: With::Faces,
        usual: value == usual,
    };
    values.into_iter().map(rung).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(rungs: &[Rung]) -> Vec<&str> {
        rungs.iter().map(|rung| rung.flags.as_str()).collect()
    }

    #[test]
    fn the_cheapest_comes_first_and_what_is_asked_for_is_not_asked() {
        let mut settings = Settings::default();
        let sides = resolutions(&settings, 64);
        let names = ["8", "16", "32", "full"].map(|name| format!("--resolution {name}"));
        assert_eq!(flags(&sides), names);
        assert!(sides[3].usual && !sides[0].usual);
        settings.schedule = Some(Schedule::Decay);
        assert_eq!(
            flags(&resolutions(&settings, 18)),
            ["--resolution 9", "--resolution auto", "--resolution full"]
        );
        assert_eq!(flags(&resolutions(&settings, 15)), ["--resolution full"]);
        settings.resolution = Some(Resolution::Auto);
        assert!(resolutions(&settings, 64).is_empty());
        let moving = tolerances(&settings);
        assert_eq!(moving[3].flags, "--tolerance 1e-5");
        assert!(moving[0].usual && moving[0].settings.tolerance == Some(0.01) && !moving[3].usual);
        assert!(tolerances(&Settings::default())[3].usual);
    }

    #[test]
    fn details_are_those_of_the_task() {
        let detail = Detail { flag: "level", values: vec![2, 3], usual: 3 };
        let rungs = details(&Settings::default(), Some(detail));
        assert_eq!(flags(&rungs), ["--level 2", "--level 3"]);
        assert!(rungs[1].usual && rungs[0].settings.detail == Some(2));
        assert!(details(&Settings::default(), None).is_empty());
    }
}
