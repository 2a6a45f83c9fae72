use std::path::Path;

use serde_json::Value;

use super::scheduled::{ScheduledSoftness, Surrogate};
use crate::softness_file::{NamedSoftness, SoftnessFileError, stored};

/// Files of custom softnesses. Their fields are those of families, except `softness`, which is the name.
impl<S: NamedSoftness> ScheduledSoftness<S> {
    /// Reads and checks the file at `path` with parameters of this softness.
    ///
    /// # Errors
    ///
    /// As [`ScheduledSoftness::load`]; if the file is of another softness than [`NAME`](NamedSoftness::NAME).
    pub fn load_own(softness: S, path: impl AsRef<Path>) -> Result<Self, SoftnessFileError> {
        Self::parse_own(softness, &stored::read(path.as_ref())?, path)
    }

    /// Parses and checks the text of a file; `path` names it in errors.
    ///
    /// # Errors
    ///
    /// As [`load_own`](Self::load_own), except for reading.
    pub fn parse_own(
        softness: S,
        text: &str,
        path: impl AsRef<Path>,
    ) -> Result<Self, SoftnessFileError> {
        let path = path.as_ref();
        let found: ScheduledSoftness<Value> = stored::parsed(text, path)?;
        stored::checked(named::<S>(&found.softness, " is"), path)?;
        if let Some(Surrogate { softness, .. }) = &found.surrogate {
            stored::checked(named::<S>(softness, " has a surrogate"), path)?;
        }
        let found = found.map(|_| softness.clone());
        stored::checked(found.check_as(|_| S::NAME), path)?;
        Ok(found)
    }

    /// Checks the numbers and writes the file at `path`, replacing what was there, through a temporary file in the same folder.
    ///
    /// # Errors
    ///
    /// If the numbers do not suit the softness, or the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), SoftnessFileError> {
        stored::save(&self.text(path.as_ref())?, path.as_ref())
    }

    /// Checks the numbers and returns the text that [`save`](Self::save) would write at `path`.
    ///
    /// # Errors
    ///
    /// If the numbers do not suit the softness.
    pub fn text(&self, path: impl AsRef<Path>) -> Result<String, SoftnessFileError> {
        stored::checked(self.check_as(|_| S::NAME), path.as_ref())?;
        stored::text(&self.clone().map(|_| S::NAME), path.as_ref())
    }
}

/// Checks that a file's softness has the name of `S`; the error has the found and the expected name.
fn named<S: NamedSoftness>(found: &Value, what: &str) -> Result<(), String> {
    let name = found.as_str();
    if name == Some(S::NAME) {
        return Ok(());
    }
    let found = match name.or_else(|| found.get("family")?.as_str()) {
        Some(name) => format!("called {name:?}"),
        None => "without a name".to_owned(),
    };
    Err(format!("{what} {found}, expected {:?}", S::NAME))
}

#[cfg(test)]
mod tests {
    use softrast_softness::{EdgeSoftness, Family, Softness};
    use softrast_tensor::{Backend, Tensor};

    use super::*;
    use crate::{AdaptiveSchedule, ScaleSchedule};

    /// A step with two parameters. A constant of it is code and not in files.
    #[derive(Clone, Debug, PartialEq)]
    struct Bent {
        stretch: f64,
    }

    impl Softness for Bent {
        fn value<B: Backend, const D: usize>(
            &self,
            phi: Tensor<B, 1>,
            x: Tensor<B, D>,
        ) -> Tensor<B, D> {
            let [scale, bend] = [0, 1].map(|k| phi.clone().narrow(0, k, 1).reshape([1; D]));
            (x * self.stretch / scale.exp() + bend).tanh() * 0.5 + 0.5
        }

        fn parameters(&self) -> usize {
            2
        }

        /// The second parameter is one over the scale.
        fn with_scale_values(&self, phi: &[f64], factor: f64) -> Vec<f64> {
            vec![phi[0] + factor.ln(), phi[1] / factor]
        }
    }

    impl NamedSoftness for Bent {
        const NAME: &'static str = "bent";
    }

    const BENT: Bent = Bent { stretch: 2.0 };

    fn example() -> ScheduledSoftness<Bent> {
        ScheduledSoftness {
            schedule: Some(ScaleSchedule { knots: vec![-3.5, -6.2], floor_px: 0.05 }),
            adaptive: Some(AdaptiveSchedule::START),
            surrogate: Some(Surrogate { softness: BENT, phi: vec![-4.0, 0.1] }),
            learning_rate: Some(0.3),
            task: Some("pose".into()),
            note: Some("a start".into()),
            ..ScheduledSoftness::constant(BENT, 0.1)
        }
    }

    fn error(text: &str) -> String {
        let message = ScheduledSoftness::parse_own(BENT, text, "a.json").unwrap_err().to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        message
    }

    #[test]
    fn a_saved_own_softness_comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bent.json");
        example().save(&path).unwrap();
        assert_eq!(ScheduledSoftness::load_own(BENT, &path).unwrap(), example());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_of_another_softness_is_refused_by_both_names() {
        let text = example().text("a.json").unwrap();
        let other = text.replacen("\"bent\"", "\"straight\"", 1);
        assert_eq!(error(&other), r#"softness "a.json" is called "straight", expected "bent""#);
        let surrogate = text.replace("\"bent\"", "\"straight\"").replacen("straight", "bent", 1);
        assert!(
            error(&surrogate).ends_with(r#"has a surrogate called "straight", expected "bent""#)
        );
        let gauss = EdgeSoftness::new(Family::Gauss);
        let family = ScheduledSoftness::constant(gauss, 0.1).text("a.json").unwrap();
        assert!(error(&family).ends_with(r#"is called "gauss", expected "bent""#));
        let nameless = r#"{"softness": null, "phi": [0, 0]}"#;
        assert!(error(nameless).ends_with(r#"is without a name, expected "bent""#));
        let message = ScheduledSoftness::parse(&text, "a.json").unwrap_err().to_string();
        let found = r#"invalid type: string "bent", expected a family such as {"family": "#;
        assert!(message.contains(found) && message.lines().count() == 1, "{message}");
    }

    #[test]
    fn numbers_of_an_own_softness_are_checked_as_those_of_a_family() {
        let with = |phi: &str, more: &str| {
            error(&format!(r#"{{"softness": "bent", "phi": {phi}{more}}}"#))
        };
        assert!(with("[0]", "").ends_with("has 1 parameters, but bent has 2"));
        assert!(with("[-90, 0]", "").contains("phi[0] is the logarithm -90, expected -80 to 80"));
        assert!(with("[0, 1e39]", "").ends_with("expected a number that fits an f32"));
        let schedule = r#", "schedule": {"knots": [-1, -80], "floor_px": 0}"#;
        assert!(
            with("[0, 1e5]", schedule).contains("has a schedule whose knot -80 makes a parameter")
        );
        assert!(with("[0, 0]", r#", "colour": 1"#).contains("unknown field `colour`"));
        let wrong = ScheduledSoftness { phi: vec![0.0, f64::NAN], ..example() };
        assert!(wrong.text("a.json").unwrap_err().to_string().contains("phi[1] is NaN"));
    }
}
