use serde::{Deserialize, Serialize};

/// What is known after an epoch; number 0 is before the first step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Its number, from 1.
    pub number: usize,
    /// Mean loss over its steps: silhouettes and smoothness; none before the first step.
    pub loss: Option<f64>,
    /// Mean soft `IoU` of the silhouettes over its steps.
    pub silhouette_iou: Option<f64>,
    /// Mean voxel `IoU` of each class on held-out shapes.
    pub voxel_iou: Vec<f64>,
    /// Parameters of the softness.
    pub phi: Vec<f64>,
    /// Time of its steps in seconds.
    pub time: Time,
}

/// Seconds that the steps of an epoch took, in all and by what they did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// All of it.
    pub all: f64,
    /// Making or reading pictures.
    pub data: f64,
    /// The network, forward and back.
    pub network: f64,
    /// The rasterizer and the loss of silhouettes, forward and back.
    pub rasterizer: f64,
    /// What keeps surfaces smooth, forward and back.
    pub smoothness: f64,
    /// The optimisers.
    pub optimizer: f64,
    /// Pictures that the network saw.
    pub pictures: usize,
}

impl Epoch {
    /// Mean of the classes.
    pub fn mean_iou(&self) -> f64 {
        self.voxel_iou.iter().sum::<f64>() / self.voxel_iou.len().max(1) as f64
    }
}

impl Time {
    /// Pictures a second; 0 without any.
    pub fn rate(&self) -> f64 {
        if self.all > 0.0 { self.pictures as f64 / self.all } else { 0.0 }
    }

    /// Part of the time that the rasterizer takes, 0 to 1.
    pub fn rasterizer_share(&self) -> f64 {
        if self.all > 0.0 { self.rasterizer / self.all } else { 0.0 }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.all += other.all;
        self.data += other.data;
        self.network += other.network;
        self.rasterizer += other.rasterizer;
        self.smoothness += other.smoothness;
        self.optimizer += other.optimizer;
        self.pictures += other.pictures;
    }
}
