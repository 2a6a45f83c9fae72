//! `solve` for the user's pictures.

use std::path::{Path, PathBuf};

use anyhow::Context;
use image::RgbImage;
use softrast_inverse::{Method, ScheduledSoftness};
use softrast_lab::{
    Error, Progress, Viewer, ViewerView, for_page, mask_png,
    parse::share,
    program::Output,
    report::{Beside, Report},
    rgb_from_planes,
};
use softrast_mesh::Mesh;
use softrast_raster::{BackendChoice, ImageSize, Pinhole};
use softrast_views::{Frame, MaskRules, PaintedView, Picture, find_mask};

use crate::{
    Common, MethodArgs, Scales, SoftnessChoice, backend,
    session::{RESULT, Session},
};

/// The shared flags of `solve`, for the user's pictures.
pub struct Given<'a, A> {
    /// The flags of the task.
    pub args: &'a A,
    /// The problem, and the folder for results.
    pub common: &'a Common,
    pub(crate) method: &'a MethodArgs,
    /// Name of the task, and the scales of its method.
    pub(crate) task: (&'static str, Scales),
    pub(crate) session: &'a Session,
}

/// The result for the user's pictures.
pub struct Answer {
    /// Its page.
    pub page: Report,
    /// Printed output, for people and programs.
    pub output: Output,
    /// Names and contents of files next to the page.
    pub files: Vec<(String, Vec<u8>)>,
    /// Files that the page links to.
    pub beside: Vec<Beside>,
}

impl<A> Given<'_, A> {
    /// The method of the command line; by default the preset of the task. An adaptive preset is replaced by the searched softness of
    /// the task, else by the learned one: an adaptive schedule controls a single run, and pictures are solved from many starts together.
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
        if self.names_softness() || method.softness.adaptive.is_none() {
            return Ok(method);
        }
        let softness = Some(match ScheduledSoftness::searched(name) {
            Ok(_) => SoftnessChoice::Searched,
            Err(_) => SoftnessChoice::Learned(None),
        });
        MethodArgs { softness, ..self.method.clone() }.method(name, scales, true)
    }

    /// Whether the command line names a softness.
    pub fn names_softness(&self) -> bool {
        !self.method.is_silent()
    }

    /// The learning rate of the command line.
    pub fn learning_rate(&self) -> Option<f64> {
        self.method.learning_rate
    }

    /// Checks, before the work, that files of these names may be written to the results. `reads`
    /// are input files that no flag names; no result replaces them.
    ///
    /// # Errors
    ///
    /// If a name is taken by a file that is no earlier result, or the folder cannot be written.
    pub fn will_write<'n>(
        &self,
        names: impl IntoIterator<Item = &'n str>,
        reads: impl IntoIterator<Item = PathBuf>,
    ) -> anyhow::Result<()> {
        reads.into_iter().for_each(|path| self.session.inputs.borrow_mut().add(&path));
        self.session.claim(names.into_iter().chain([RESULT]))
    }

    /// The folder for results.
    pub fn folder(&self) -> &Path {
        &self.session.out
    }

    /// The backend, initialized.
    ///
    /// # Errors
    ///
    /// If no backend has that name, or it has no adapter.
    pub fn backend(&self) -> anyhow::Result<BackendChoice> {
        backend(self.common.backend.as_deref())
    }

    /// Progress over this many steps, which stops on Ctrl-C.
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

/// Conversion of pictures to masks.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct MaskFlags {
    /// Use black as the mask
    #[arg(long)]
    pub invert: bool,

    /// Threshold of the mask: brighter pixels belong to it, 0 to 1, instead of soft edges
    #[arg(long, value_name = "X", value_parser = share, allow_negative_numbers = true)]
    pub threshold: Option<f64>,

    /// Use the pixels of class N as the mask: an index of the palette, or the level as a whole number
    #[arg(long, value_name = "N", conflicts_with = "threshold")]
    pub label: Option<u32>,

    /// Folder of masks with the names of the pictures, with any file extension [default: masks that
    /// the camera file names, a folder masks beside the pictures, or the pictures themselves]
    #[arg(long, value_name = "DIR")]
    pub masks: Option<PathBuf>,
}

impl MaskFlags {
    /// Whether the command line has a flag of masks.
    pub fn is_given(&self) -> bool {
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

    /// Loads the mask from a file.
    ///
    /// # Errors
    ///
    /// If it is missing, no picture, or has no pixel that is at least half white.
    pub fn load(&self, path: &Path) -> anyhow::Result<Picture> {
        let Self { invert, threshold, label, .. } = *self;
        let rules = MaskRules { invert, threshold, label };
        Picture::load_mask_by(&rules, path)
    }
}

/// A mesh with views of it, for a page: the name, camera, mask and note of each. The page opens with view `opens`.
///
/// # Errors
///
/// If a mask cannot be encoded.
pub fn viewer<'a>(
    mesh: &Mesh,
    views: impl Iterator<Item = (String, &'a Pinhole, &'a Picture, String)>,
    opens: Option<usize>,
) -> anyhow::Result<Viewer> {
    // A page stores coordinates in 32 bits.
    let frame = Frame::of_mesh(mesh);
    let view = |(name, camera, mask, note): (_, &Pinhole, &Picture, _)| {
        let Pinhole { rotation, translation, focal, centre, size } = frame.camera(camera);
        let ImageSize { height, width } = size;
        let mask_png = mask_png(mask.pixels(), mask.size().width)?;
        Ok(ViewerView { name, rotation, translation, focal, centre, width, height, mask_png, note })
    };
    Ok(Viewer {
        positions: mesh.positions().iter().map(|&p| frame.point(p)).collect(),
        faces: mesh.faces().to_vec(),
        colours: mesh.colours().map(<[_]>::to_vec),
        views: views.map(view).collect::<anyhow::Result<_>>()?,
        opens,
    })
}

/// The picture of a view, and colours drawn from its camera, red, green, blue and coverage, both over black for a page.
pub fn beside(view: &PaintedView, [red, green, blue, _]: [Vec<f64>; 4]) -> [RgbImage; 2] {
    let ImageSize { height, width } = view.view.camera.size;
    let channels = view.over_black();
    let picture = channels.iter().flat_map(|channel| channel.pixels());
    let planes = [picture.map(|&x| f64::from(x)).collect(), [red, green, blue].concat()];
    planes.map(|planes: Vec<f64>| for_page(rgb_from_planes(&planes, width, height)))
}
