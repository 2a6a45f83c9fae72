use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{
    DepthSoftness, SoftnessFileError,
    file::{check, parse, read, text, write},
};

/// A depth softness and its parameters, as kept in a JSON file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthSoftnessFile {
    /// Which depth softness.
    pub depth_softness: DepthSoftness,
    /// Its parameters φ, as many as [`DepthSoftness::parameters`] says.
    pub phi: Vec<f64>,
    /// Where the parameters come from, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

impl DepthSoftnessFile {
    /// Reads and checks the file at `path`.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is not JSON, has unknown or missing fields, or parameters that do not
    /// suit the softness.
    pub fn load(path: &Path) -> Result<Self, SoftnessFileError> {
        Self::parse(&read(path)?, path)
    }

    /// Parses and checks the text of a file; `path` names it in errors.
    ///
    /// # Errors
    ///
    /// Those of [`load`](DepthSoftnessFile::load) but for reading.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SoftnessFileError> {
        let file: Self = parse(text, path)?;
        file.check(path)?;
        Ok(file)
    }

    /// Checks the parameters and writes the file at `path`, replacing what was there, through a
    /// temporary file in the same folder.
    ///
    /// # Errors
    ///
    /// If the parameters do not suit the softness, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SoftnessFileError> {
        self.check(path)?;
        write(path, self)
    }

    /// Checks the parameters; what [`save`](DepthSoftnessFile::save) would write at `path`.
    ///
    /// # Errors
    ///
    /// If the parameters do not suit the softness.
    pub fn text(&self, path: &Path) -> Result<String, SoftnessFileError> {
        self.check(path)?;
        text(path, self)
    }

    fn check(&self, path: &Path) -> Result<(), SoftnessFileError> {
        let softness = self.depth_softness;
        let expected = [softness.parameters(), softness.logarithms()];
        check(path, softness.name(), expected, &self.phi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Family;

    #[test]
    fn a_saved_depth_softness_comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.json");
        for depth_softness in [DepthSoftness::Family(Family::Exp), DepthSoftness::Mlp] {
            let phi = depth_softness.default_phi(0.1);
            let file = DepthSoftnessFile { depth_softness, phi, note: Some("a start".into()) };
            file.save(&path).unwrap();
            assert_eq!(DepthSoftnessFile::load(&path).unwrap(), file);
        }
    }

    #[test]
    fn parameters_that_do_not_suit_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.json");
        for (text, part) in [
            (
                r#"{"depth_softness": "depth_mlp", "phi": [0]}"#,
                "1 parameters, but depth_mlp has 56",
            ),
            (r#"{"depth_softness": "gauss", "phi": [99]}"#, "phi[0] is the logarithm 99"),
            (r#"{"depth_softness": "deep", "phi": [99]}"#, "unknown depth softness \"deep\""),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = DepthSoftnessFile::load(&path).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
