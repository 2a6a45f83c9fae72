//! Files of schedules: bundled ones, reading and writing, and checks.

use std::path::Path;

use softrast_softness::Softness;

use super::scheduled::ScheduledSoftness;
use crate::softness_file::stored::{
    SoftnessFileError, Stored, check_phi, fits_f32, learned, stored,
};

impl ScheduledSoftness {
    /// The default of a task's program: the best known, learned or searched. Its note describes its origin.
    ///
    /// Presets are learned on their task, for `pose` and `shape3d` with an [adaptive schedule](crate::AdaptiveSchedule), except for `occlusion`,
    /// whose preset a search found.
    ///
    /// # Errors
    ///
    /// If there is none for a task of this name.
    pub fn preset(task: &str) -> Result<Self, SoftnessFileError> {
        match task {
            "occlusion" => Self::searched(task),
            "pose" | "shape3d" => Self::learned(&format!("{task}-adaptive")),
            _ => Self::learned(task),
        }
    }

    /// The result of a search for a task, with more free parameters than families have by default. Its note describes the search.
    ///
    /// # Errors
    ///
    /// If there is none for a task of this name.
    pub fn searched(task: &str) -> Result<Self, SoftnessFileError> {
        match task {
            "shape3d" => Self::parse(include_str!("../../searched/shape3d.json"), task),
            "occlusion" => Self::parse(include_str!("../../searched/occlusion.json"), task),
            _ => Err(SoftnessFileError::Unknown {
                name: task.to_owned(),
                known: "shape3d, occlusion".to_owned(),
            }),
        }
    }
}

stored!(ScheduledSoftness);

impl Stored for ScheduledSoftness {
    const LEARNED: &'static [(&'static str, &'static str)] = learned![
        ".json":
        "shape2d", "shape2d-mlp", "shape2d-surrogate", "shape3d", "shape3d-mlp", "shape3d-surrogate",
        "shape2d-adaptive", "shape3d-adaptive",
        "pose", "pose-mlp", "pose-surrogate", "pose-adaptive", "occlusion", "occlusion-mlp", "networks/pose",
        "networks/pose-15-35", "networks/pose-55-75", "networks/shape3d", "networks/shape3d-0",
        "networks/shape3d-30", "networks/shape3d-60", "networks/shape3d-minus30",
        "networks/shape3d-minus60"
    ];

    fn check(&self) -> Result<(), String> {
        self.check_as(|softness| softness.family.name())
    }
}

impl<S: Softness> ScheduledSoftness<S> {
    /// Returns the found and the expected value if it is invalid; `name` gives the name of a softness.
    pub(super) fn check_as(&self, name: impl Fn(&S) -> &'static str) -> Result<(), String> {
        let surrogate = self.surrogate.iter().map(|of| (&of.softness, &of.phi));
        let parameters: Vec<_> =
            [(&self.softness, &self.phi)].into_iter().chain(surrogate).collect();
        for &(softness, phi) in &parameters {
            let expected = [softness.parameters(), softness.logarithms()];
            check_phi(name(softness), expected, phi)?;
        }
        if let Some(rate) = self.learning_rate.filter(|rate| !(*rate > 0.0 && rate.is_finite())) {
            return Err(format!(": the learning rate is {rate}, expected a positive number"));
        }
        if let Some(end) = self.rate_end.filter(|end| !(*end > 0.0 && *end <= 1.0)) {
            return Err(format!(": the rate ends at {end} of itself, expected a share of 1"));
        }
        match &self.adaptive {
            Some(_) if self.rate_end.is_some() => {
                return Err(
                    " has a rate_end next to an adaptive schedule, which has its own".into()
                );
            }
            Some(_) if self.is_constant() => {
                return Err(" has an adaptive schedule, but no schedule of its scale".into());
            }
            Some(adaptive) => {
                adaptive
                    .check()
                    .map_err(|wrong| format!(" has an adaptive schedule with {wrong}"))?;
            }
            None => {}
        }
        let Some(schedule) = &self.schedule else { return Ok(()) };
        schedule.check().map_err(|wrong| format!(" has a schedule with {wrong}"))?;
        // Weights of a network are divided by the scale.
        for (softness, phi) in parameters {
            for knot in &schedule.knots {
                let scaled = softness.with_scale_values(phi, knot.exp());
                if let Some(wrong) = scaled.into_iter().find(|x| !fits_f32(*x)) {
                    return Err(format!(
                        " has a schedule whose knot {knot} makes a parameter {wrong}, expected a number that fits an f32"
                    ));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use softrast_softness::{EdgeSoftness, Family};

    use super::*;
    use crate::{AdaptiveSchedule, DepthSoftnessFile, ScaleSchedule, Surrogate};

    fn example(family: Family) -> ScheduledSoftness {
        let softness = EdgeSoftness::squared(family);
        let schedule = ScaleSchedule { knots: vec![-3.5, -6.2], floor_px: 0.05 };
        ScheduledSoftness {
            softness,
            phi: softness.default_phi(1e-4),
            schedule: Some(schedule),
            adaptive: Some(AdaptiveSchedule::START),
            surrogate: Some(Surrogate { softness, phi: softness.default_phi(1e-2) }),
            learning_rate: Some(0.3),
            rate_end: None,
            task: Some("pose".into()),
            note: Some("a start".into()),
        }
    }

    fn error(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        fs::write(&path, text).unwrap();
        ScheduledSoftness::load(&path).unwrap_err().to_string()
    }

    #[test]
    fn a_saved_softness_comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        for family in Family::ALL {
            let file = example(family);
            file.save(&path).unwrap();
            assert_eq!(ScheduledSoftness::load(&path).unwrap(), file);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_whose_schedule_is_called_path_is_read() {
        let file = example(Family::Gauss);
        let text = serde_json::to_string(&file).unwrap();
        let older = text.replace(r#""schedule":"#, r#""path":"#);
        assert_ne!(text, older);
        assert_eq!(serde_json::from_str::<ScheduledSoftness>(&older).unwrap(), file);
    }

    #[test]
    fn a_file_with_the_older_names_of_an_adaptive_schedule_is_read() {
        let text = serde_json::to_string(&example(Family::Gauss)).unwrap();
        let names = [
            ("adaptive", "feedback"),
            ("duration", "passage"),
            ("stall_threshold", "stuck"),
            ("stall_slope", "early"),
            ("reserve", "room"),
        ];
        let older = names.into_iter().fold(text.clone(), |text, (name, older)| {
            let replaced = text.replace(&format!("\"{name}\":"), &format!("\"{older}\":"));
            assert_ne!(text, replaced, "{name}");
            replaced
        });
        let read = ScheduledSoftness::parse(&older, "a.json").unwrap();
        assert_eq!(read, example(Family::Gauss));
        assert_eq!(serde_json::to_string(&read).unwrap(), text);
        // Distinct values, in the order of a file of version 0.2.0.
        let older = r#"{"steps": 300, "passage": 4.5, "patience": -0.25, "stuck": -2.5,
            "early": 3.5, "room": -1.0, "rate_end": -0.75}"#;
        let read: AdaptiveSchedule = serde_json::from_str(older).unwrap();
        assert_eq!((read.steps, read.parameters()), (300, [4.5, -0.25, -2.5, 3.5, -1.0, -0.75]));
    }

    #[test]
    fn a_bundled_softness_is_found_by_its_older_name() {
        for task in ["pose", "shape2d", "shape3d"] {
            let [name, older] = ["adaptive", "feedback"].map(|kind| format!("{task}-{kind}"));
            let [found, by_older] = [name, older].map(|name| ScheduledSoftness::learned(&name));
            assert_eq!(found.unwrap(), by_older.unwrap(), "{task}");
        }
    }

    #[test]
    fn a_cause_is_said_once() {
        let error = ScheduledSoftness::load(Path::new("none.json")).unwrap_err();
        assert!(error.to_string().starts_with("cannot read softness \"none.json\": "), "{error}");
        assert!(std::error::Error::source(&error).is_none());
    }

    #[test]
    fn a_file_with_one_wrong_bit_or_no_end_is_a_softness_or_one_line() {
        let whole = example(Family::Gamma).text("a.json").unwrap().into_bytes();
        let flipped = (0..8 * whole.len()).map(|bit| {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            bytes
        });
        let cut = (0..whole.len()).map(|end| whole[..end].to_vec());
        let mut read = 0;
        for text in flipped.chain(cut).filter_map(|bytes| String::from_utf8(bytes).ok()) {
            match ScheduledSoftness::parse(&text, "a.json") {
                Ok(softness) => {
                    let phi = softness.phi_at(1.0, 64);
                    assert!(phi.iter().all(|x| x.is_finite()), "{phi:?} of {text}");
                    read += 1;
                }
                Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
            }
        }
        assert!(read > 100, "{read}");
    }

    #[test]
    fn unknown_fields_and_families_are_refused() {
        let message = error(
            r#"{"softness": {"family": "gauss", "squared": true}, "phi": [0], "colour": "red"}"#,
        );
        assert!(message.contains("unknown field `colour`"), "{message}");
        let message = error(r#"{"softness": {"family": "gaus", "squared": true}, "phi": [0]}"#);
        assert!(message.contains("`gaus`") && message.contains("gumbel_min"), "{message}");
    }

    #[test]
    fn parameters_that_do_not_suit_are_refused_by_name() {
        let message = error(r#"{"softness": {"family": "exp", "squared": false}, "phi": [0]}"#);
        assert!(message.ends_with("softness.json\" has 1 parameters, but exp has 2"), "{message}");
        let message = error(r#"{"softness": {"family": "gauss", "squared": false}, "phi": [-90]}"#);
        assert!(message.ends_with("phi[0] is the logarithm -90, expected -80 to 80"), "{message}");
        let message =
            error(r#"{"softness": {"family": "gauss", "squared": false}, "phi": [1e999]}"#);
        assert!(message.contains("number out of range"), "{message}");
    }

    #[test]
    fn a_schedule_that_cannot_be_followed_is_refused() {
        for (schedule, cause) in [
            (r#"{"knots": [], "floor_px": 0}"#, "0 knots, expected 1 to 16"),
            (r#"{"knots": [-1, 99], "floor_px": 0}"#, "a knot of 99, expected -80 to 80"),
            (r#"{"knots": [-1], "floor_px": -1}"#, "a floor of -1 pixels, expected 0 to 1000000"),
            (
                r#"{"knots": [-1], "floor_px": 1e7}"#,
                "a floor of 10000000 pixels, expected 0 to 1000000",
            ),
        ] {
            let softness = r#"{"family": "gauss", "squared": false}"#;
            let message = error(&format!(
                r#"{{"softness": {softness}, "phi": [0], "schedule": {schedule}}}"#
            ));
            assert!(message.ends_with(cause), "{message}");
        }
    }

    #[test]
    fn a_learning_rate_that_leads_nowhere_is_refused() {
        for rate in ["0", "-1"] {
            let message = error(&format!(
                r#"{{"softness": {{"family": "gauss", "squared": false}}, "phi": [0], "learning_rate": {rate}}}"#
            ));
            assert!(message.contains(&format!("the learning rate is {rate}")), "{message}");
            let message = error(&format!(
                r#"{{"softness": {{"family": "gauss", "squared": false}}, "phi": [0], "rate_end": {rate}}}"#
            ));
            assert!(message.contains(&format!("the rate ends at {rate}")), "{message}");
        }
    }

    #[test]
    fn a_surrogate_is_checked_like_the_softness() {
        let softness = r#"{"family": "gauss", "squared": false}"#;
        let surrogate = r#"{"softness": {"family": "exp", "squared": false}, "phi": [0]}"#;
        let message =
            error(&format!(r#"{{"softness": {softness}, "phi": [0], "surrogate": {surrogate}}}"#));
        assert!(message.ends_with("has 1 parameters, but exp has 2"), "{message}");
    }

    #[test]
    fn a_softness_that_is_not_a_number_is_not_saved() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        let mut file = example(Family::Exp);
        file.phi[1] = f64::NAN;
        let message = file.save(&path).unwrap_err().to_string();
        assert!(
            message.ends_with("phi[1] is NaN, expected a number that fits an f32"),
            "{message}"
        );
        assert!(!path.exists());
    }

    #[test]
    fn everything_learned_is_valid_and_tells_where_it_comes_from() {
        for name in ScheduledSoftness::learned_names() {
            assert!(ScheduledSoftness::learned(name).unwrap().note.is_some(), "{name}");
        }
        for task in ["shape2d", "shape3d", "pose", "occlusion"] {
            let preset = ScheduledSoftness::preset(task).unwrap();
            assert!(preset.task.as_deref().is_none_or(|of| of == task) && preset.note.is_some());
        }
        for name in DepthSoftnessFile::learned_names() {
            assert!(DepthSoftnessFile::learned(name).unwrap().note.is_some(), "{name}");
        }
        let message = ScheduledSoftness::learned("nothing").unwrap_err().to_string();
        assert!(
            message
                .starts_with("no softness of that kind is called \"nothing\"; there are shape2d,")
        );
    }
}
