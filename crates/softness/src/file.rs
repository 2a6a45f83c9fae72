use std::{fs, io, path::Path};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{EdgeSoftness, ScalePath, Softness, SoftnessFileError, Surrogate, path::MOST_KNOTS};

/// The largest size of a parameter that is a logarithm: its exponential must fit an f32.
pub(crate) const LARGEST_LOGARITHM: f64 = 80.0;

/// A softness and its parameters, as kept in a JSON file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoftnessFile {
    /// Which softness.
    pub softness: EdgeSoftness,
    /// Its parameters φ, as many as [`Softness::parameters`] says.
    pub phi: Vec<f64>,
    /// How its width moves over a run; a softness without one stays as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<ScalePath>,
    /// What the gradient is taken of, where that is not the softness itself; it moves along the same path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surrogate: Option<Surrogate>,
    /// The learning rate of the optimisations that it was learned on, which suits it best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning_rate: Option<f64>,
    /// The task that it was learned on; without one, the rate is for any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// Where the parameters come from, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

impl SoftnessFile {
    /// Reads and checks the file at `path`.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is not JSON, has unknown or missing fields, or parameters that do not
    /// suit the family.
    pub fn load(path: &Path) -> Result<Self, SoftnessFileError> {
        Self::parse(&read(path)?, path)
    }

    /// Parses and checks the text of a file; `path` names it in errors.
    ///
    /// # Errors
    ///
    /// Those of [`load`](SoftnessFile::load) but for reading.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SoftnessFileError> {
        let file: Self = parse(text, path)?;
        file.check(path)?;
        Ok(file)
    }

    /// Checks the parameters and writes the file at `path`, replacing what was there.
    ///
    /// The text goes to a temporary file in the same folder first, so that `path` never holds half
    /// a softness.
    ///
    /// # Errors
    ///
    /// If the parameters do not suit the family, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SoftnessFileError> {
        self.check(path)?;
        write(path, self)
    }

    /// Checks the parameters; what [`save`](SoftnessFile::save) would write at `path`.
    ///
    /// # Errors
    ///
    /// If the parameters do not suit the family.
    pub fn text(&self, path: &Path) -> Result<String, SoftnessFileError> {
        self.check(path)?;
        text(path, self)
    }

    fn check(&self, path: &Path) -> Result<(), SoftnessFileError> {
        let felt = self.surrogate.iter().map(|felt| (felt.softness.family, &felt.phi));
        for (family, phi) in [(self.softness.family, &self.phi)].into_iter().chain(felt) {
            check(path, family.name(), [family.parameters(), family.logarithms()], phi)?;
        }
        if let Some(found) = self.learning_rate.filter(|rate| !(*rate > 0.0 && rate.is_finite())) {
            return Err(SoftnessFileError::LearningRate { path: path.to_owned(), found });
        }
        let wrong = |what: String| SoftnessFileError::Path { path: path.to_owned(), what };
        let Some(ScalePath { knots, floor_px }) = &self.path else { return Ok(()) };
        if !(1..=MOST_KNOTS).contains(&knots.len()) {
            return Err(wrong(format!("{} knots, expected 1 to {MOST_KNOTS}", knots.len())));
        }
        if let Some(knot) = knots.iter().find(|k| k.is_nan() || k.abs() > LARGEST_LOGARITHM) {
            let limit = LARGEST_LOGARITHM;
            return Err(wrong(format!("a knot of {knot}, expected -{limit} to {limit}")));
        }
        if !floor_px.is_finite() || *floor_px < 0.0 {
            return Err(wrong(format!("a floor of {floor_px} pixels, expected 0 or more")));
        }
        Ok(())
    }
}

/// The text of the file at `path`.
pub(crate) fn read(path: &Path) -> Result<String, SoftnessFileError> {
    fs::read_to_string(path)
        .map_err(|reason| SoftnessFileError::Read { path: path.to_owned(), reason })
}

/// Parses the text of the JSON file at `path`.
pub(crate) fn parse<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, SoftnessFileError> {
    serde_json::from_str(text)
        .map_err(|reason| SoftnessFileError::Parse { path: path.to_owned(), reason })
}

/// Writes a JSON file at `path`, by way of a temporary one beside it.
pub(crate) fn write(path: &Path, content: &impl Serialize) -> Result<(), SoftnessFileError> {
    let failed = |reason| SoftnessFileError::Write { path: path.to_owned(), reason };
    let text = text(path, content)?;
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.tmp", std::process::id()));
    fs::write(&beside, text).and_then(|()| fs::rename(&beside, path)).map_err(|reason| {
        // What is left of it is of no use; that it may not exist is no second error.
        let _ = fs::remove_file(&beside);
        failed(reason)
    })
}

/// The text of a JSON file for `path`.
pub(crate) fn text(path: &Path, content: &impl Serialize) -> Result<String, SoftnessFileError> {
    let text = serde_json::to_string_pretty(content).map_err(io::Error::from);
    let failed = |reason| SoftnessFileError::Write { path: path.to_owned(), reason };
    text.map(|text| text + "\n").map_err(failed)
}

/// Checks that `phi` has the expected length, of which so many at the front are logarithms.
pub(crate) fn check(
    path: &Path,
    family: &'static str,
    [expected, logarithms]: [usize; 2],
    phi: &[f64],
) -> Result<(), SoftnessFileError> {
    let (path, found) = (path.to_owned(), phi.len());
    if found != expected {
        return Err(SoftnessFileError::Length { path, family, found, expected });
    }
    for (index, &found) in phi.iter().enumerate() {
        if !found.is_finite() {
            return Err(SoftnessFileError::NotFinite { path, index, found });
        }
        if index < logarithms && found.abs() > LARGEST_LOGARITHM {
            return Err(SoftnessFileError::Logarithm { path, index, found });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Family;

    fn example(family: Family) -> SoftnessFile {
        let softness = EdgeSoftness { family, squared: true };
        let path = ScalePath { knots: vec![-3.5, -6.2], floor_px: 0.05 };
        SoftnessFile {
            softness,
            phi: softness.default_phi(1e-4),
            path: Some(path),
            surrogate: Some(Surrogate { softness, phi: softness.default_phi(1e-2) }),
            learning_rate: Some(0.3),
            task: Some("pose".into()),
            note: Some("a start".into()),
        }
    }

    fn error(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        fs::write(&path, text).unwrap();
        SoftnessFile::load(&path).unwrap_err().to_string()
    }

    #[test]
    fn a_saved_softness_comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        for family in Family::ALL {
            let file = example(family);
            file.save(&path).unwrap();
            assert_eq!(SoftnessFile::load(&path).unwrap(), file);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_cause_is_said_once() {
        let error = SoftnessFile::load(Path::new("none.json")).unwrap_err();
        assert!(error.to_string().starts_with("cannot read softness \"none.json\": "), "{error}");
        assert!(std::error::Error::source(&error).is_none());
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
    fn a_path_that_cannot_be_followed_is_refused() {
        for (path, part) in [
            (r#"{"knots": [], "floor_px": 0}"#, "0 knots, expected 1 to 16"),
            (r#"{"knots": [-1, 99], "floor_px": 0}"#, "a knot of 99, expected -80 to 80"),
            (r#"{"knots": [-1], "floor_px": -1}"#, "a floor of -1 pixels, expected 0 or more"),
        ] {
            let softness = r#"{"family": "gauss", "squared": false}"#;
            let message =
                error(&format!(r#"{{"softness": {softness}, "phi": [0], "path": {path}}}"#));
            assert!(message.ends_with(part), "{message}");
        }
    }

    #[test]
    fn a_learning_rate_that_leads_nowhere_is_refused() {
        for rate in ["0", "-1"] {
            let message = error(&format!(
                r#"{{"softness": {{"family": "gauss", "squared": false}}, "phi": [0], "learning_rate": {rate}}}"#
            ));
            assert!(message.contains(&format!("the learning rate is {rate}")), "{message}");
        }
    }

    #[test]
    fn a_surrogate_is_checked_like_the_softness() {
        let softness = r#"{"family": "gauss", "squared": false}"#;
        let felt = r#"{"softness": {"family": "exp", "squared": false}, "phi": [0]}"#;
        let message =
            error(&format!(r#"{{"softness": {softness}, "phi": [0], "surrogate": {felt}}}"#));
        assert!(message.ends_with("has 1 parameters, but exp has 2"), "{message}");
    }

    #[test]
    fn a_softness_that_is_not_a_number_is_not_saved() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        let mut file = example(Family::Exp);
        file.phi[1] = f64::NAN;
        let message = file.save(&path).unwrap_err().to_string();
        assert!(message.ends_with("phi[1] is NaN, expected a finite number"), "{message}");
        assert!(!path.exists());
    }
}
