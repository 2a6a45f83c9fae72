//! `solve` for pictures that the user gives.

use std::path::{Path, PathBuf};

use anyhow::Context;

use softrast_inverse::{Method, ScheduledSoftness};
use softrast_lab::{
    Error, Progress, ViewerView, mask_png,
    parse::share,
    program::Output,
    report::{Beside, Report},
};
use softrast_raster::{BackendChoice, Pinhole};
use softrast_views::{MaskRules, Picture, find_mask};

use crate::{
    Common, MethodArgs, Scales, SoftnessChoice, backend,
    session::{RESULT, Session},
};

/// The flags that every `solve` has, for pictures that the user gives.
pub struct Given<'a, A> {
    /// Those of the task.
    pub args: &'a A,
    /// What is solved, and where results go.
    pub common: &'a Common,
    pub(crate) method: &'a MethodArgs,
    /// Name of the task, and the scales of its method.
    pub(crate) task: (&'static str, Scales),
    pub(crate) session: &'a Session,
}

/// What came of pictures that the user gave.
pub struct Answer {
    /// Its page.
    pub page: Report,
    /// What is said, to people and programs.
    pub output: Output,
    /// Names and contents of files beside the page.
    pub files: Vec<(String, Vec<u8>)>,
    /// Files that the page links to.
    pub beside: Vec<Beside>,
}

impl<A> Given<'_, A> {
    /// The softness; without a word the preset of the task, or where that has feedback what a search found for it, else what was learned on
    /// it: feedback goes with one run at a time, and pictures are solved from many starts side by side.
    ///
    /// # Errors
    ///
    /// If flags contradict each other or a file cannot be used.
    pub fn method(&self) -> anyhow::Result<Method> {
        if self.method.softness == Some(SoftnessChoice::Auto) {
            return Err(Error::usage(
                "--softness auto needs seeds to choose on: with pictures of your own name a family or a file",
            ));
        }
        let (name, scales) = &self.task;
        let method = self.method.method(name, scales, true)?;
        if self.names_softness() || method.softness.feedback.is_none() {
            return Ok(method);
        }
        let softness = Some(match ScheduledSoftness::searched(name) {
            Ok(_) => SoftnessChoice::Searched,
            Err(_) => SoftnessChoice::Learned(None),
        });
        MethodArgs { softness, ..self.method.clone() }.method(name, scales, true)
    }

    /// Whether the command line says which softness.
    pub fn names_softness(&self) -> bool {
        !self.method.is_silent()
    }

    /// The learning rate of the command line.
    pub fn learning_rate(&self) -> Option<f64> {
        self.method.learning_rate
    }

    /// Makes sure, before the work, that files of these names may be written beside the results. `reads` are files that the work reads
    /// without a flag that names them, which no result replaces.
    ///
    /// # Errors
    ///
    /// If a name is that of a file which is no earlier result, or the folder cannot be written.
    pub fn will_write<'n>(
        &self,
        names: impl IntoIterator<Item = &'n str>,
        reads: impl IntoIterator<Item = PathBuf>,
    ) -> anyhow::Result<()> {
        reads.into_iter().for_each(|path| self.session.inputs.borrow_mut().add(&path));
        self.session.claim(names.into_iter().chain([RESULT]))
    }

    /// Where results go.
    pub fn folder(&self) -> &Path {
        &self.session.out
    }

    /// The backend, set up.
    ///
    /// # Errors
    ///
    /// If there is none of that name or no adapter for it.
    pub fn backend(&self) -> anyhow::Result<BackendChoice> {
        backend(self.common.backend.as_deref())
    }

    /// Progress over so many steps, which ends on Ctrl-C.
    ///
    /// # Errors
    ///
    /// If the user has stopped the program.
    pub fn progress(&self, steps: usize) -> anyhow::Result<Progress> {
        let mut progress = Progress::of_program(self.common.quiet);
        progress.expect(steps);
        progress.begin(self.task.0.to_owned(), 1, steps)?;
        Ok(progress)
    }
}

/// How pictures become masks.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct MaskFlags {
    /// Take what is black for the mask
    #[arg(long)]
    pub invert: bool,

    /// Take for the mask what is at least so bright, 0 to 1, instead of keeping soft edges
    #[arg(long, value_name = "X", value_parser = share, allow_negative_numbers = true)]
    pub threshold: Option<f64>,

    /// Take for the mask the pixels of class N: an entry of the palette, or the level as a whole number
    #[arg(long, value_name = "N", conflicts_with = "threshold")]
    pub label: Option<u32>,

    /// Folder of masks with the names of the pictures, whatever their endings [default: masks that the camera file names, a folder masks beside the pictures, or the pictures themselves]
    #[arg(long, value_name = "DIR")]
    pub masks: Option<PathBuf>,
}

impl MaskFlags {
    /// Whether the command line says something of masks.
    pub fn asked(&self) -> bool {
        let Self { invert, threshold, label, masks } = self;
        *invert || threshold.is_some() || label.is_some() || masks.is_some()
    }

    /// The file with the mask of a picture in the folder of masks; None if no folder was given.
    ///
    /// # Errors
    ///
    /// If the folder has none for the picture.
    pub fn of(&self, picture: &Path) -> anyhow::Result<Option<PathBuf>> {
        let Some(folder) = &self.masks else { return Ok(None) };
        let found = find_mask(folder, &picture.to_string_lossy());
        found.map(Some).with_context(|| {
            format!("{}: no mask in {} has its name", picture.display(), folder.display())
        })
    }

    /// The mask in a file.
    ///
    /// # Errors
    ///
    /// If it is missing, no picture, or has nothing that is half white.
    pub fn load(&self, path: &Path) -> anyhow::Result<Picture> {
        let Self { invert, threshold, label, .. } = *self;
        let rules = MaskRules { invert, threshold, label };
        Picture::load_mask_by(&rules, path)
    }
}

/// A camera and the mask that it took, for a page that shows them with a mesh.
///
/// # Errors
///
/// If the mask cannot be encoded.
pub fn seen_by(
    name: String,
    camera: &Pinhole,
    mask: &Picture,
    note: String,
) -> anyhow::Result<ViewerView> {
    let Pinhole { rotation, translation, focal, centre, size } = *camera;
    let mask_png = mask_png(mask.pixels(), mask.size().width)?;
    Ok(ViewerView {
        name,
        rotation,
        translation,
        focal,
        centre,
        width: size.width,
        height: size.height,
        mask_png,
        note,
    })
}
