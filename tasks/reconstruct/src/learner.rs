use std::{
    path::Path,
    sync::{Mutex, PoisonError},
    time::Instant,
};

use anyhow::{Context, ensure};
use softrast_lab::World;
use softrast_raster::RasterBackend;
use softrast_softness::SoftStep;
use softrast_tensor::{
    Autodiff, Tensor,
    burn::{
        module::{AutodiffModule, Module},
        optim::{Adam, AdamConfig, GradientsParams, Optimizer, adaptor::OptimizerAdaptor},
        record::{FullPrecisionSettings, NamedMpkBytesRecorder, Recorder},
    },
    numbers,
};

use crate::{
    Checkpoint, Network, Settings, Template, Time,
    objective::{Objective, soft_step},
    pairs::PairBatch,
    parts::{received, sent},
};

/// Added to the root of Adam's second moment. Source: the default, which the released code does not change.
const EPSILON: f32 = 1e-8;

/// A network and a softness, with separate optimisers.
pub(crate) struct Learner<B: RasterBackend> {
    network: Network<Autodiff<B>>,
    softness: SoftStep<Autodiff<B>>,
    of_network: OptimizerAdaptor<Adam, Network<Autodiff<B>>, Autodiff<B>>,
    of_softness: OptimizerAdaptor<Adam, SoftStep<Autodiff<B>>, Autodiff<B>>,
    objective: Objective<Autodiff<B>>,
}

/// Results of a step.
pub(crate) struct Step {
    /// Before the step: `1 - IoU` of the silhouettes, and the smoothness.
    pub(crate) silhouette: f64,
    pub(crate) smoothness: f64,
    pub(crate) time: Time,
}

/// Losses and gradients of a batch.
struct Gradients {
    silhouette: f64,
    smoothness: f64,
    of_network: GradientsParams,
    of_softness: GradientsParams,
    time: Time,
}

/// burn has one seed for the whole process: locked while weights are drawn from it.
static DRAWING: Mutex<()> = Mutex::new(());

/// The recorder of burn to bytes that returns an error for invalid data, instead of a panic.
type Bytes = NamedMpkBytesRecorder<FullPrecisionSettings>;

impl<B: RasterBackend> Learner<B> {
    /// An untrained learner.
    ///
    /// # Errors
    ///
    /// If the T-conorm's name is unknown.
    pub(crate) fn new(settings: &Settings, device: &B::Device) -> anyhow::Result<Self> {
        let vertices = Template::<B>::new(device).vertices();
        let drawing = DRAWING.lock().unwrap_or_else(PoisonError::into_inner);
        B::seed(device, settings.seed);
        let network = Network::new(settings.width, vertices, device);
        // burn draws weights at their first use: now, while the seed is locked.
        let _count = network.num_params();
        drop(drawing);
        let softness = soft_step(settings.softness, &settings.phi, device);
        let objective = Objective::new(settings.t_conorm()?, &softness, device);
        let adam = AdamConfig::new().with_epsilon(EPSILON);
        Ok(Self { network, softness, of_network: adam.init(), of_softness: adam.init(), objective })
    }

    /// The current network, without gradients.
    pub(crate) fn network(&self) -> Network<B> {
        self.network.valid()
    }

    /// The current parameters of the softness.
    pub(crate) fn phi(&self) -> Vec<f64> {
        numbers(self.softness.phi.val())
    }

    /// Starts an epoch.
    pub(crate) fn begin(&mut self) {
        self.objective.begin();
    }

    /// One step of both optimisers; `rates` are those of the network and of the softness.
    pub(crate) fn step(&mut self, batch: &PairBatch<Autodiff<B>>, rates: [f64; 2]) -> Step {
        self.objective.renew(&self.softness);
        let start = Instant::now();
        let gradients = self.gradients(batch);
        self.apply(gradients, rates, start)
    }

    /// One step on a batch that comes in `parts` of equal size, distributed over the processes of `world`: each of n processes computes
    /// every n-th part. The means over the parts are summed in their order, so that the result does not depend on the number of processes.
    ///
    /// Batch norms see one part at a time.
    pub(crate) fn step_in_parts(
        &mut self,
        own: &[PairBatch<Autodiff<B>>],
        parts: usize,
        world: &World,
        rates: [f64; 2],
    ) -> Step {
        self.objective.renew(&self.softness);
        let (start, mut time) = (Instant::now(), Time::default());
        let before = sent(&self.network, &GradientsParams::new());
        let mut given = Vec::new();
        for part in own {
            self.network = received(self.network.clone(), &before).0;
            let gradients = self.gradients(part);
            // Taking a record updates its states.
            let _ = self.network.clone().into_record();
            time.add(&gradients.time);
            let losses = [gradients.silhouette, gradients.smoothness].map(|loss| loss as f32);
            let numbers = [
                losses.to_vec(),
                sent(&self.network, &gradients.of_network),
                sent(&self.softness, &gradients.of_softness),
            ];
            given.push(numbers.concat());
        }
        let mut mean = Vec::new();
        for part in 0..parts {
            let owner = part % world.count();
            let mut numbers = match owner == world.rank() {
                true => std::mem::take(&mut given[part / world.count()]),
                false => vec![0.0; 2 + before.len() + self.phi().len()],
            };
            world.broadcast(owner, &mut numbers);
            if mean.is_empty() {
                mean = vec![0.0; numbers.len()];
            }
            mean.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += x / parts as f32);
        }
        let (losses, mean) = mean.split_at(2);
        let (network, softness) = mean.split_at(before.len());
        let (with_states, of_network) = received(self.network.clone(), network);
        self.network = with_states;
        let (_, of_softness) = received(self.softness.clone(), softness);
        let [silhouette, smoothness] = [losses[0], losses[1]].map(f64::from);
        let gradients = Gradients { silhouette, smoothness, of_network, of_softness, time };
        self.apply(gradients, rates, start)
    }

    /// Losses and gradients of a batch.
    ///
    /// The backward pass is split, to time its components: from either loss to the vertices (and
    /// φ), then from the vertices through the network.
    fn gradients(&mut self, batch: &PairBatch<Autodiff<B>>) -> Gradients {
        let start = Instant::now();
        let mut time = Time { pictures: batch.views.len(), ..Time::default() };
        let (centre, displacement) = self.network.forward(batch.pictures.clone());
        let vertices = self.objective.template().deformed(centre, displacement);
        // Some backends are asynchronous: waiting makes the times accurate.
        wait::<B>(&vertices);
        let mut network = start.elapsed();

        let clock = Instant::now();
        let leaf = || Tensor::from_inner(vertices.clone().inner()).require_grad();
        let smooth = leaf();
        let smoothness = self.objective.smoothness(smooth.clone());
        let of_smoothness = smooth.grad_remove(&mut smoothness.backward());
        let smoothness = numbers(smoothness.inner())[0];
        time.smoothness = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let drawn = leaf();
        let PairBatch { pictures, views } = batch;
        let silhouette = self.objective.silhouettes(drawn.clone(), pictures, views, &self.softness);
        let mut grads = silhouette.backward();
        let of_silhouettes = drawn.grad_remove(&mut grads);
        let of_softness = GradientsParams::from_module(&mut grads, &self.softness);
        let silhouette = numbers(silhouette.inner())[0];
        time.rasterizer = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let parts = [of_smoothness, of_silhouettes].into_iter().flatten();
        let grad = parts.fold(vertices.clone().inner().zeros_like(), |sum, part| sum + part);
        let mut grads = (vertices * Tensor::from_inner(grad)).sum().backward();
        let of_network = GradientsParams::from_module(&mut grads, &self.network);
        network += clock.elapsed();
        time.network = network.as_secs_f64();
        Gradients { silhouette, smoothness, of_network, of_softness, time }
    }

    /// Applies gradients, whose computation began at `start`.
    fn apply(&mut self, gradients: Gradients, rates: [f64; 2], start: Instant) -> Step {
        let Gradients { silhouette, smoothness, of_network, of_softness, mut time } = gradients;
        let [network_rate, softness_rate] = rates;
        let clock = Instant::now();
        self.network = self.of_network.step(network_rate, self.network.clone(), of_network);
        if softness_rate > 0.0 {
            self.softness =
                self.of_softness.step(softness_rate, self.softness.clone(), of_softness);
        }
        time.optimizer = clock.elapsed().as_secs_f64();
        time.all = start.elapsed().as_secs_f64();
        Step { silhouette, smoothness, time }
    }

    /// The state of all modules and optimisers, as bytes.
    ///
    /// # Errors
    ///
    /// If burn cannot write them.
    pub(crate) fn to_bytes(&self) -> anyhow::Result<Vec<u8>> {
        let modules = (self.network.clone().into_record(), self.softness.clone().into_record());
        let optimizers = (self.of_network.to_record(), self.of_softness.to_record());
        let recorder = Bytes::default();
        Ok(Recorder::<Autodiff<B>>::record(&recorder, (modules, optimizers), ())?)
    }

    /// The learner with the state of [`Learner::to_bytes`].
    ///
    /// # Errors
    ///
    /// If the bytes are invalid.
    pub(crate) fn with_bytes(mut self, bytes: Vec<u8>, device: &B::Device) -> anyhow::Result<Self> {
        let recorder = Bytes::default();
        let loaded = Recorder::<Autodiff<B>>::load::<Records<B>>(&recorder, bytes, device);
        let (modules, optimizers) = loaded.context("its weights cannot be read: train anew")?;
        let expected = (self.network.sizes(), self.phi().len());
        self.network = self.network.load_record(modules.0);
        self.softness = self.softness.load_record(modules.1);
        let found = (self.network.sizes(), self.phi().len());
        ensure!(found == expected, "its weights are not those of such a network: train anew");
        self.of_network = self.of_network.load_record(optimizers.0);
        self.of_softness = self.of_softness.load_record(optimizers.1);
        Ok(self)
    }
}

/// State of a learner: both modules, then both optimisers.
type Records<B> = (
    (ModuleRecord<B, Network<Autodiff<B>>>, ModuleRecord<B, SoftStep<Autodiff<B>>>),
    (OptimizerRecord<B, Network<Autodiff<B>>>, OptimizerRecord<B, SoftStep<Autodiff<B>>>),
);
type ModuleRecord<B, M> = <M as Module<Autodiff<B>>>::Record;
type OptimizerRecord<B, M> =
    <OptimizerAdaptor<Adam, M, Autodiff<B>> as Optimizer<M, Autodiff<B>>>::Record;

/// Waits until a tensor has been computed.
fn wait<B: RasterBackend>(tensor: &Tensor<Autodiff<B>, 3>) {
    let _ = tensor.clone().inner().narrow(2, 0, 1).into_data();
}

/// The network of a checkpoint.
pub(crate) fn trained<B: RasterBackend>(
    path: &Path,
    device: &B::Device,
) -> anyhow::Result<(Checkpoint, Network<B>)> {
    let mut checkpoint = Checkpoint::load(path)?;
    let records = std::mem::take(&mut checkpoint.records);
    let learner = Learner::<B>::new(&checkpoint.header.settings, device)?;
    let learner = learner
        .with_bytes(records, device)
        .with_context(|| format!("{} cannot be used: train anew", path.display()))?;
    let network = learner.network();
    Ok((checkpoint, network))
}
