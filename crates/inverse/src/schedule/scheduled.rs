use std::{path::Path, sync::Arc};

use serde::{Deserialize, Serialize};
use softrast_raster::{SoftRenderer, low_level::Rasterizer};
use softrast_softness::{EdgeSoftness, Softness};

use super::{feedback::Feedback, scale_schedule::ScaleSchedule};
use crate::softness_file::stored::{
    SoftnessFileError, Stored, check_phi, fits_f32, learned, stored,
};

/// A second softness whose slope replaces that of the first in the backward pass: a surrogate gradient.
///
/// The image is that of the first softness: a sharp image with a wide gradient, which is not the derivative of the
/// image. If the scale of the first follows a [`ScaleSchedule`], this one is evaluated at `d / scale(t)` too: it keeps
/// its ratio to the first.
///
/// ```
/// use softrast_inverse::{ScheduledSoftness, Surrogate};
/// use softrast_softness::{EdgeSoftness, Family, Softness};
///
/// let edge = EdgeSoftness::new(Family::Logistic);
/// let softness = ScheduledSoftness::decay(edge, 0.5, 0.125).with_surrogate_scale(1.0);
/// let Surrogate { softness: wide, phi } = softness.surrogate_at(1.0, 64).unwrap();
/// assert!((softness.width_at(1.0, 64) - 0.125).abs() < 1e-12 && (wide.scale(&phi) - 0.25).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surrogate<S = EdgeSoftness> {
    /// The softness.
    pub softness: S,
    /// Its parameters φ; their number is [`Softness::parameters`].
    pub phi: Vec<f64>,
}

/// A softness with its parameters and the schedule of its scale.
///
/// In a JSON file its fields have these names; `path` is an older name of `schedule`. A file of a
/// custom softness has its [`NAME`](crate::NamedSoftness::NAME) in the field `softness`.
///
/// ```
/// use softrast_inverse::ScheduledSoftness;
///
/// let learned = ScheduledSoftness::learned("pose")?;
/// assert!(learned.scale_at(1.0, 64) < learned.scale_at(0.0, 64));
/// assert!(ScheduledSoftness::learned_names().any(|name| name == "pose"));
/// # Ok::<(), softrast_inverse::SoftnessFileError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound(deserialize = "S: Deserialize<'de>"))]
pub struct ScheduledSoftness<S = EdgeSoftness> {
    /// The softness.
    pub softness: S,
    /// Its parameters φ; their number is [`Softness::parameters`].
    pub phi: Vec<f64>,
    /// Schedule of its width; without one the width is fixed.
    #[serde(alias = "path", default, skip_serializing_if = "Option::is_none")]
    pub schedule: Option<ScaleSchedule>,
    /// Adaptive schedule; without it, progress follows time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback: Option<Feedback>,
    /// Surrogate of the gradient, if that is not the softness's own; it follows the same schedule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surrogate: Option<Surrogate<S>>,
    /// Learning rate of the optimisations that it was learned on, which suits it best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning_rate: Option<f64>,
    /// Factor of the learning rate at the end of a run, in (0, 1], reached geometrically. Feedback has its own factor instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_end: Option<f64>,
    /// The task that it was learned on; without one, the learning rate applies to any task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// Origin of the parameters, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

impl ScheduledSoftness {
    /// The default of a task's program: the best known, learned or searched. Its note describes its origin.
    ///
    /// Presets are learned on their task, for `pose` and `shape3d` with [feedback](Feedback), except for `occlusion`,
    /// whose preset a search found.
    ///
    /// # Errors
    ///
    /// If there is none for a task of this name.
    pub fn preset(task: &str) -> Result<Self, SoftnessFileError> {
        match task {
            "occlusion" => Self::searched(task),
            "pose" | "shape3d" => Self::learned(&format!("{task}-feedback")),
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

impl<S: Softness> ScheduledSoftness<S> {
    /// A softness with a fixed `scale`, in NDC (NDC² if squared).
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    pub fn constant(softness: S, scale: f64) -> Self {
        Self::new(softness, scale, None)
    }

    /// A softness whose scale goes geometrically from `first` to `last`, in NDC (NDC² if squared);
    /// fixed if both are equal.
    ///
    /// # Panics
    ///
    /// If one of the scales is not positive.
    pub fn decay(softness: S, first: f64, last: f64) -> Self {
        let mut knots = vec![ln_scale(first), ln_scale(last)];
        knots.dedup();
        Self::new(softness, 1.0, Some(ScaleSchedule { knots, floor_px: 0.0 }))
    }

    fn new(softness: S, scale: f64, schedule: Option<ScaleSchedule>) -> Self {
        let phi = softness.default_phi(scale);
        let (feedback, surrogate, task, note) = (None, None, None, None);
        let (learning_rate, rate_end) = (None, None);
        Self { softness, phi, schedule, feedback, surrogate, learning_rate, rate_end, task, note }
    }

    /// Adds the same softness at `scale`, in NDC (NDC² if squared), as surrogate.
    ///
    /// With a moving scale, this is the surrogate's first scale; the floor of the schedule is
    /// excluded from the ratio of both, as it depends on the size of the image.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    #[must_use]
    pub fn with_surrogate_scale(self, scale: f64) -> Self {
        let first = self.schedule.as_ref().map_or(1.0, |schedule| schedule.at(0.0, 0.0));
        let phi = self.softness.default_phi(scale / first);
        let softness = self.softness.clone();
        Self { surrogate: Some(Surrogate { softness, phi }), ..self }
    }

    /// Whether the width is fixed.
    pub fn is_constant(&self) -> bool {
        self.schedule.as_ref().is_none_or(|schedule| schedule.knots.len() == 1)
    }

    /// Number of free parameters: φ, that of the surrogate, the knots of the schedule, which
    /// replace a family's own scale, and those of the feedback.
    pub fn parameters(&self) -> usize {
        let replaced = self.softness.logarithms().min(1);
        let knots = self.schedule.as_ref().map_or(0, |schedule| schedule.knots.len() - replaced);
        let feedback = self.feedback.map_or(0, |_| Feedback::PARAMETERS);
        self.phi.len() + knots + feedback + self.surrogate.as_ref().map_or(0, |of| of.phi.len())
    }

    /// The scale of the schedule at `progress` of a run, 0 to 1, on images of `size` × `size` pixels;
    /// without a schedule that of the softness. In NDC (NDC² if squared).
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn scale_at(&self, progress: f64, size: usize) -> f64 {
        self.factor_at(progress, size).unwrap_or_else(|| self.softness.scale(&self.phi))
    }

    /// The width of the soft edge at `progress` of a run, 0 to 1, in NDC, on images of `size` × `size`
    /// pixels.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn width_at(&self, progress: f64, size: usize) -> f64 {
        self.softness.width(&self.phi_at(progress, size))
    }

    /// Parameters of the softness at `progress` of a run, 0 to 1, on images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn phi_at(&self, progress: f64, size: usize) -> Vec<f64> {
        scaled(&self.softness, &self.phi, self.factor_at(progress, size))
    }

    /// The surrogate at `progress` of a run, 0 to 1, on images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn surrogate_at(&self, progress: f64, size: usize) -> Option<Surrogate<S>> {
        let Surrogate { softness, phi } = self.surrogate.as_ref()?;
        let phi = scaled(softness, phi, self.factor_at(progress, size));
        Some(Surrogate { softness: softness.clone(), phi })
    }

    /// A renderer with this softness at `progress` of a run, 0 to 1, and its surrogate, if it has one.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or `progress` is not in [0, 1].
    pub fn renderer_at(
        &self,
        progress: f64,
        rasterizer: Rasterizer,
        faces: Arc<[[u32; 3]]>,
    ) -> SoftRenderer<S> {
        let size = rasterizer.size.shorter();
        let phi = self.phi_at(progress, size);
        let renderer = SoftRenderer::with_rasterizer(rasterizer, faces, self.softness.clone(), phi);
        match self.surrogate_at(progress, size) {
            Some(Surrogate { softness, phi }) => renderer.with_surrogate_phi(softness, phi),
            None => renderer,
        }
    }

    /// The schedule's factor of the scale of the parameters.
    fn factor_at(&self, progress: f64, size: usize) -> Option<f64> {
        let schedule = self.schedule.as_ref()?;
        Some(schedule.at(schedule.floor(&self.softness, size), progress))
    }

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
        match &self.feedback {
            Some(_) if self.rate_end.is_some() => {
                return Err(" has a rate_end beside feedback, which has one of its own".into());
            }
            Some(_) if self.is_constant() => {
                return Err(" has feedback, which moves along a schedule, but no schedule".into());
            }
            Some(feedback) => {
                feedback.check().map_err(|wrong| format!(" has feedback with {wrong}"))?;
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

impl<S> ScheduledSoftness<S> {
    /// This value with each softness replaced by `softness` of it.
    pub(super) fn map<T>(self, softness: impl Fn(S) -> T) -> ScheduledSoftness<T> {
        let of =
            |found: Surrogate<S>| Surrogate { softness: softness(found.softness), phi: found.phi };
        ScheduledSoftness {
            surrogate: self.surrogate.map(of),
            softness: softness(self.softness),
            phi: self.phi,
            schedule: self.schedule,
            feedback: self.feedback,
            learning_rate: self.learning_rate,
            rate_end: self.rate_end,
            task: self.task,
            note: self.note,
        }
    }
}

/// The logarithm of a scale.
///
/// # Panics
///
/// If it is not positive.
fn ln_scale(scale: f64) -> f64 {
    assert!(scale > 0.0 && scale.is_finite(), "scale {scale} is not positive");
    scale.ln()
}

fn scaled(softness: &impl Softness, phi: &[f64], factor: Option<f64>) -> Vec<f64> {
    factor.map_or_else(|| phi.to_vec(), |factor| softness.with_scale_values(phi, factor))
}

stored!(ScheduledSoftness);

impl Stored for ScheduledSoftness {
    const LEARNED: &'static [(&'static str, &'static str)] = learned![
        ".json":
        "shape2d", "shape2d-mlp", "shape2d-surrogate", "shape3d", "shape3d-mlp", "shape3d-surrogate",
        "shape2d-feedback", "shape3d-feedback",
        "pose", "pose-mlp", "pose-surrogate", "pose-feedback", "occlusion", "occlusion-mlp", "networks/pose",
        "networks/pose-15-35", "networks/pose-55-75", "networks/shape3d", "networks/shape3d-0",
        "networks/shape3d-30", "networks/shape3d-60", "networks/shape3d-minus30",
        "networks/shape3d-minus60"
    ];

    fn check(&self) -> Result<(), String> {
        self.check_as(|softness| softness.family.name())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use softrast_softness::Family;

    use super::*;
    use crate::DepthSoftnessFile;

    fn example(family: Family) -> ScheduledSoftness {
        let softness = EdgeSoftness::squared(family);
        let schedule = ScaleSchedule { knots: vec![-3.5, -6.2], floor_px: 0.05 };
        ScheduledSoftness {
            softness,
            phi: softness.default_phi(1e-4),
            schedule: Some(schedule),
            feedback: Some(Feedback::START),
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
