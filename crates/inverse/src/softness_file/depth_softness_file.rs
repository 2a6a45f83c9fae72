use std::path::Path;

use serde::{Deserialize, Serialize};
use softrast_softness::DepthSoftness;

use super::stored::{SoftnessFileError, Stored, check_phi, learned, stored};

/// A depth softness and its parameters, as stored in a JSON file; fixed over a run.
///
/// ```
/// use softrast_inverse::{DepthSoftnessFile, SoftnessFileError};
///
/// let preset = DepthSoftnessFile::preset("occlusion")?;
/// assert_eq!(preset.phi.len(), preset.depth_softness.parameters());
/// # Ok::<(), SoftnessFileError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthSoftnessFile {
    /// The depth softness.
    pub depth_softness: DepthSoftness,
    /// Its parameters φ; their number is [`DepthSoftness::parameters`].
    pub phi: Vec<f64>,
    /// Origin of the parameters, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

impl DepthSoftnessFile {
    /// The default of a task's program, together with [`ScheduledSoftness::preset`](crate::ScheduledSoftness::preset).
    ///
    /// # Errors
    ///
    /// If there is none for a task of this name.
    pub fn preset(task: &str) -> Result<Self, SoftnessFileError> {
        match task {
            "occlusion" => Self::parse(include_str!("../../searched/occlusion_depth.json"), task),
            _ => Self::learned(task),
        }
    }
}

stored!(DepthSoftnessFile);

impl Stored for DepthSoftnessFile {
    const LEARNED: &'static [(&'static str, &'static str)] =
        learned!["_depth.json": "occlusion", "occlusion-mlp"];

    fn check(&self) -> Result<(), String> {
        let softness = self.depth_softness;
        check_phi(softness.name(), [softness.parameters(), softness.logarithms()], &self.phi)
    }
}

#[cfg(test)]
mod tests {
    use softrast_softness::Family;

    use super::*;

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
