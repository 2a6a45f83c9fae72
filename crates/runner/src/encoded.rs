use std::io;

use anyhow::Context;
use base64::{Engine, engine::general_purpose::STANDARD};
use serde::{Deserialize, Serialize};

use crate::{Run, animation, picture};

/// Pictures of a run as files.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Encoded {
    /// PNG.
    #[serde(with = "text")]
    pub(crate) before_after: Vec<u8>,
    /// GIF.
    #[serde(with = "text")]
    pub(crate) animation: Vec<u8>,
}

/// Small pictures are enlarged to at least this width, in pixels.
const WIDTH: u32 = 256;

impl Encoded {
    /// Takes the pictures out of the runs, and encodes the first.
    ///
    /// # Errors
    ///
    /// If an encoder fails.
    pub(crate) fn take(runs: &mut [Run]) -> anyhow::Result<Option<Self>> {
        let mut pictures = runs.iter_mut().filter_map(|run| run.pictures.take());
        let (first, _others) = (pictures.next(), pictures.count());
        let Some(pictures) = first else {
            return Ok(None);
        };
        let row = [
            ("target", &pictures.target),
            ("start", &pictures.start),
            ("result", &pictures.result),
            ("difference", &pictures.difference),
        ];
        let row = picture::labelled_row(&row, WIDTH);
        let mut png = io::Cursor::new(Vec::new());
        row.write_to(&mut png, image::ImageFormat::Png)
            .context("cannot encode before_after.png")?;
        let animation = animation::gif(&pictures.target, &pictures.frames)
            .context("cannot encode animation.gif")?;
        Ok(Some(Self { before_after: png.into_inner(), animation }))
    }
}

/// Bytes as base64.
mod text {
    use serde::{Deserializer, Serializer, de::Error as _};

    use super::{Deserialize, Engine, STANDARD};

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&STANDARD.encode(bytes))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u8>, D::Error> {
        STANDARD.decode(String::deserialize(from)?).map_err(D::Error::custom)
    }
}
