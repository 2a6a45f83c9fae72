use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use anyhow::{Context, bail, ensure};
use softrast_lab::{Error, Inputs, OutputFolder, Progress, World, program::say};
use softrast_raster::RasterBackend;
use softrast_tensor::Autodiff;

use crate::{
    Checkpoint, Epoch, Header, Score, Settings, Shapes, Split, Template, Time, data_set,
    learner::Learner,
    pairs::Pairs,
    report,
    score::{score, with_mean},
    sheet,
};

/// Files of a training in its folder.
pub(crate) const CHECKPOINT: &str = "checkpoint.bin";
pub(crate) const REPORT: &str = "report.html";
const HISTORY: &str = "history.json";

/// Share of the epochs after which the learning rates fall, and their factor.
///
/// Source: docs/notes.md, Reconstruction (after 150,000 of 250,000 steps, times 0.3).
const LATE: (f64, f64) = (0.6, 0.3);

/// A training and its output folder.
#[derive(Clone, Debug)]
pub struct Training {
    /// The settings.
    pub settings: Settings,
    /// Number of epochs.
    pub epochs: usize,
    /// Folder for checkpoint, contact sheets and report.
    pub out: PathBuf,
    /// Whether to continue from the checkpoint in the folder.
    pub resume: bool,
    /// Whether to show progress.
    pub visible: bool,
    /// The command line that reproduces it.
    pub command: String,
    /// Input files, which it never replaces.
    pub inputs: Inputs,
}

impl Training {
    /// Trains until the last epoch, and returns the history with the scores of the undeformed sphere.
    ///
    /// After every epoch the checkpoint, a contact sheet and the report are written atomically, each by itself.
    ///
    /// # Errors
    ///
    /// If shapes cannot be read, the folder has another training, files cannot be written, or the
    /// loss becomes non-finite.
    pub fn run<B: RasterBackend>(
        &self,
        world: &World,
        device: &B::Device,
    ) -> anyhow::Result<(Header, Vec<f64>)> {
        let Settings { pairs, parts, .. } = self.settings;
        if !pairs.is_multiple_of(parts) {
            let message =
                format!("the {pairs} pairs of a step cannot be divided by --parts {parts}");
            return Err(Error::usage(message));
        }
        if world.count() > parts {
            let count = world.count();
            let message = format!(
                "{count} processes cannot share a step in {parts} parts: give --parts {count}"
            );
            return Err(Error::usage(message));
        }
        let path = self.out.join(CHECKPOINT);
        let shapes = data_set::open(&self.settings.data, Split::Train, self.settings.seed)?;
        let held_out = data_set::open(&self.settings.data, Split::Val, self.settings.seed)?;
        let (mut header, mut learner) = self.start::<B>(&path, shapes.as_ref(), device)?;
        let mut folder = world.is_first().then(|| self.folder()).transpose()?;
        let template = Template::new(device);
        let mut bar = Progress::of_program(!self.visible || !world.is_first());
        bar.expect(self.epochs * self.settings.steps);
        bar.skip(header.epochs.len().saturating_sub(1), self.settings.steps);
        let views = [self.settings.val, 2];
        let judge = |learner: &Learner<B>| -> anyhow::Result<Score> {
            score(&learner.network(), &template, held_out.as_ref(), views, device)
        };
        if header.epochs.is_empty() {
            let voxel_iou = judge(&learner)?.classes;
            let phi = learner.phi();
            let time = Time::default();
            let first = Epoch { number: 0, loss: None, silhouette_iou: None, voxel_iou, phi, time };
            self.say(&first, world);
            header.epochs.push(first);
        }
        let mut sphere = Vec::new();
        while header.epochs.len() <= self.epochs || sphere.is_empty() {
            if header.epochs.len() <= self.epochs {
                let epoch = self.epoch(
                    &mut learner,
                    &shapes,
                    header.epochs.len(),
                    &mut bar,
                    world,
                    device,
                )?;
                header.epochs.push(epoch);
            }
            let judged = judge(&learner)?;
            sphere = judged.sphere;
            if let Some(epoch) = header.epochs.last_mut() {
                epoch.voxel_iou = judged.classes;
                self.say(epoch, world);
            }
            if let Some(folder) = &mut folder {
                let shapes = held_out.as_ref();
                self.write(&header, &learner, folder, &sphere, &template, shapes, device)?;
            }
        }
        bar.finish();
        Ok((header, sphere))
    }

    /// The output folder, after checking that all files of the training may be written.
    fn folder(&self) -> anyhow::Result<OutputFolder> {
        let mut folder = OutputFolder::open(&self.out, "reconstruct train", &self.inputs)?;
        if folder.file(CHECKPOINT).exists() {
            // It has been read, therefore a training wrote it.
            folder.adopt(CHECKPOINT)?;
        }
        folder.claim([REPORT, HISTORY])?;
        let sheets = (1..=self.epochs).map(sheet_name);
        folder.claim(sheets.filter(|name| folder.file(name).is_file()))?;
        Ok(folder)
    }

    /// A new learner, or the one of the checkpoint.
    fn start<B: RasterBackend>(
        &self,
        path: &Path,
        shapes: &dyn Shapes,
        device: &B::Device,
    ) -> anyhow::Result<(Header, Learner<B>)> {
        let learner = Learner::new(&self.settings, device)?;
        let name = path.display();
        if !path.exists() {
            if self.resume {
                say(&format!("there is no {name}, so nothing to go on from"));
            }
            let classes = shapes.classes().to_vec();
            let header = Header { settings: self.settings.clone(), classes, epochs: Vec::new() };
            return Ok((header, learner));
        }
        if !self.resume {
            bail!(
                "{name} is there already: go on from it with --resume, or choose another folder \
                 with --out"
            );
        }
        let Checkpoint { header, records } = Checkpoint::load(path)?;
        if let Some(difference) = header.settings.difference(&self.settings) {
            bail!("{name} belongs to another training: {difference}");
        }
        ensure!(
            header.classes == shapes.classes(),
            "{name} was trained on the classes {}, but there are {}",
            header.classes.join(", "),
            shapes.classes().join(", "),
        );
        let learner = learner
            .with_bytes(records, device)
            .with_context(|| format!("{name} cannot be used: train anew"))?;
        Ok((header, learner))
    }

    /// All steps of one epoch.
    fn epoch<B: RasterBackend>(
        &self,
        learner: &mut Learner<B>,
        shapes: &Arc<dyn Shapes>,
        number: usize,
        bar: &mut Progress,
        world: &World,
        device: &B::Device,
    ) -> anyhow::Result<Epoch> {
        let Settings { pairs, parts, steps, seed, learning_rate, softness_rate, .. } =
            self.settings;
        let late = number as f64 > LATE.0 * self.epochs as f64;
        let factor = if late { LATE.1 } else { 1.0 };
        let all = Pairs { shapes: shapes.clone(), seed, epoch: number as u64 };
        learner.begin();
        bar.begin(format!("epoch {number}/{}", self.epochs), 1, steps)?;
        let (mut loss, mut soft, mut time) = (0.0, 0.0, Time::default());
        let mut clock = Instant::now();
        for step_number in 0..steps {
            // The parts of this process.
            let size = pairs / parts;
            let own = (step_number * parts..(step_number + 1) * parts).skip(world.rank());
            let own = own.step_by(world.count()).map(|part| part * size..(part + 1) * size);
            let own: Vec<_> = own
                .map(|pairs| all.batch::<Autodiff<B>>(pairs, device))
                .collect::<anyhow::Result<_>>()?;
            let data = clock.elapsed().as_secs_f64();
            let rates = [learning_rate, softness_rate].map(|rate| factor * rate);
            let step = match own.as_slice() {
                [batch] if parts == 1 => learner.step(batch, rates),
                own => learner.step_in_parts(own, parts, world, rates),
            };
            let now = step.silhouette + step.smoothness;
            ensure!(
                now.is_finite(),
                "the loss is {now} in epoch {number}: try a smaller --learning-rate; the checkpoint \
                 of the epoch before is kept"
            );
            loss += now / steps as f64;
            soft += (1.0 - step.silhouette) / steps as f64;
            time.add(&Time { data, all: step.time.all + data, ..step.time });
            bar.step(step_number + 1, now)?;
            clock = Instant::now();
        }
        bar.end();
        Ok(Epoch {
            number,
            loss: Some(loss),
            silhouette_iou: Some(soft),
            voxel_iou: Vec::new(),
            phi: learner.phi(),
            time,
        })
    }

    /// Writes the results after an epoch.
    #[expect(clippy::too_many_arguments, reason = "they are all that a training holds")]
    fn write<B: RasterBackend>(
        &self,
        header: &Header,
        learner: &Learner<B>,
        folder: &mut OutputFolder,
        sphere: &[f64],
        template: &Template<B>,
        held_out: &dyn Shapes,
        device: &B::Device,
    ) -> anyhow::Result<()> {
        let number = header.epochs.len() - 1;
        let sheet = sheet::sheet(&learner.network(), template, held_out, device)?;
        let sheet = softrast_lab::png(&sheet)?;
        // Sheets of a few epochs summarize the training: the first, one in between, and the last.
        let shown = [1.min(number), number.div_ceil(3), number];
        let mut sheets: Vec<(usize, Vec<u8>)> = Vec::new();
        for number in shown {
            if sheets.iter().all(|(other, _)| *other != number) {
                let earlier = || std::fs::read(folder.file(&sheet_name(number))).ok();
                let png =
                    if number + 1 == header.epochs.len() { Some(sheet.clone()) } else { earlier() };
                sheets.extend(png.map(|png| (number, png)));
            }
        }
        let page = report::html(header, sphere, &sheets, &self.command)?;
        let checkpoint = Checkpoint { header: header.clone(), records: learner.to_bytes()? };
        folder.stage(&sheet_name(number), &sheet)?;
        folder.stage(REPORT, page.as_bytes())?;
        folder.stage(HISTORY, &serde_json::to_vec_pretty(header)?)?;
        folder.stage(CHECKPOINT, &checkpoint.bytes()?)?;
        let sheets: Vec<String> = (0..number).map(sheet_name).collect();
        Ok(folder.commit_beside(|name| sheets.iter().any(|sheet| sheet == name))?)
    }

    /// Prints the results of an epoch to stderr.
    fn say(&self, epoch: &Epoch, world: &World) {
        if self.visible && world.is_first() {
            let loss = epoch.loss.map_or_else(String::new, |loss| format!("loss {loss:.4}, "));
            let (iou, time) = (epoch.mean_iou(), epoch.time);
            let share = 100.0 * time.rasterizer_share();
            let speed = format!("{:.1} pictures/s, rasterizer {share:.0} %", time.rate());
            eprintln!("epoch {}/{}: {loss}voxel IoU {iou:.3}, {speed}", epoch.number, self.epochs);
        }
    }
}

fn sheet_name(epoch: usize) -> String {
    format!("epoch_{epoch:03}.png")
}

/// A line for each class and the mean, with the `IoU` of the sphere.
pub(crate) fn table(classes: &[String], iou: &[f64], sphere: &[f64]) -> String {
    let mut text = format!("{:<14} {:>9} {:>9}", "voxel IoU", "network", "sphere");
    let names = classes.iter().map(String::as_str).chain(["mean"]);
    for ((name, iou), sphere) in names.zip(with_mean(iou)).zip(with_mean(sphere)) {
        text += &format!("\n{name:<14} {iou:>9.3} {sphere:>9.3}");
    }
    text
}
