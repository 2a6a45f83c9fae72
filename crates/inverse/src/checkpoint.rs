use anyhow::{anyhow, ensure};
use serde::{Deserialize, Serialize};
use softrast_meta::{OuterLoop, Progress};

const FORMAT: &str = "softrast learning checkpoint 2";

/// State of learning in a file, and its job.
///
/// ```
/// use softrast_inverse::Checkpoint;
/// use softrast_meta::{Adam, MetaGradient, OuterLoop, Progress, Validation};
///
/// let validation = Validation { seed: 0, count: 1, every: 1, patience: None };
/// let (estimator, optimizer) = (MetaGradient::default(), Adam::new(0.1));
/// let learner = OuterLoop { estimator, optimizer, clip: 1.0, steps: 9, batch: 1, seed: 1, validation };
/// let progress = Progress::new(vec![0.5]);
/// let text = Checkpoint { job: "pose".into(), progress: progress.clone() }.text()?;
/// assert_eq!(Checkpoint::parse(text.as_bytes(), "pose", &learner, 1)?, progress);
/// let other = Checkpoint::parse(text.as_bytes(), "shape", &learner, 1).unwrap_err();
/// assert!(other.to_string().contains("another job"));
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Everything that determines the result: task and settings, as worded by the learning program.
    /// A checkpoint of another job is refused.
    pub job: String,
    /// State of the outer loop.
    pub progress: Progress,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    checksum: String,
    checkpoint: Checkpoint,
}

impl Checkpoint {
    /// The text that [`Checkpoint::parse`] reads, with a checksum in it.
    ///
    /// # Errors
    ///
    /// If a number in it cannot be written.
    pub fn text(&self) -> Result<String, serde_json::Error> {
        let (format, checksum) = (FORMAT.to_owned(), self.checksum()?);
        let file = File { format, checksum, checkpoint: self.clone() };
        Ok(serde_json::to_string_pretty(&file)? + "\n")
    }

    /// Parses a checkpoint of `job`, for an `outer_loop` that continues it with `parameters` numbers.
    ///
    /// # Errors
    ///
    /// If it is damaged, is of another job, or its numbers do not suit the outer loop.
    pub fn parse(
        text: &[u8],
        job: &str,
        outer_loop: &OuterLoop,
        parameters: usize,
    ) -> anyhow::Result<Progress> {
        let damaged = |reason: String| {
            anyhow!("it is no checkpoint, or a damaged one: {reason}; remove it to start over")
        };
        let file: File = serde_json::from_slice(text).map_err(|e| damaged(e.to_string()))?;
        let File { format, checksum, checkpoint } = file;
        let sum = checkpoint.checksum().map_err(|e| damaged(e.to_string()))?;
        let Self { job: found, progress } = checkpoint;
        ensure!(
            format == FORMAT,
            damaged(format!("its format is {format:?}, expected {FORMAT:?}"))
        );
        ensure!(checksum == sum, damaged(format!("its checksum is {checksum}, not {sum}")));
        ensure!(found == job, "it belongs to another job: it is for {found}, this is {job}");
        progress.check(outer_loop.steps, parameters).map_err(damaged)?;
        Ok(progress)
    }

    /// FNV-1a of the compact JSON text, the same before writing and after reading.
    fn checksum(&self) -> Result<String, serde_json::Error> {
        let bytes = serde_json::to_vec(self)?;
        let mix = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
        Ok(format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix)))
    }
}
