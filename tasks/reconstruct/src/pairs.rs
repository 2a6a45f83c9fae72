use std::{ops::Range, sync::Arc};

use rand::{Rng, SeedableRng, rngs::StdRng};
use rayon::prelude::*;
use softrast_tensor::{Backend, Element, Tensor, TensorData};

use crate::{SIZE, Shapes, VIEWS};

/// Number of values of a picture: four planes.
pub(crate) const PICTURE: usize = 4 * SIZE * SIZE;

/// A shape and two of its views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pair {
    class: usize,
    shape: usize,
    views: [usize; 2],
}

/// The pairs of one epoch: classes, shapes and views are drawn uniformly.
///
/// A pair depends only on the seed, the epoch and its number, so that a resumed training sees the
/// same pairs.
#[derive(Debug)]
pub(crate) struct Pairs {
    pub(crate) shapes: Arc<dyn Shapes>,
    pub(crate) seed: u64,
    pub(crate) epoch: u64,
}

impl Pairs {
    fn get(&self, index: usize) -> Pair {
        let mut seed = [0; 32];
        for (bytes, part) in seed.chunks_mut(8).zip([self.seed, self.epoch, index as u64]) {
            bytes.copy_from_slice(&part.to_le_bytes());
        }
        let mut random = StdRng::from_seed(seed);
        let class = random.random_range(0..self.shapes.classes().len());
        let shape = random.random_range(0..self.shapes.count(class));
        Pair { class, shape, views: [(); 2].map(|()| random.random_range(0..VIEWS)) }
    }

    /// The pictures of the pairs with these numbers, made in parallel.
    ///
    /// # Errors
    ///
    /// If a picture cannot be read.
    pub(crate) fn batch<B: Backend>(
        &self,
        numbers: Range<usize>,
        device: &B::Device,
    ) -> anyhow::Result<PairBatch<B>> {
        let pairs: Vec<Pair> = numbers.map(|number| self.get(number)).collect();
        let seen: Vec<_> = [0, 1].iter().flat_map(|&k| pairs.iter().map(move |p| (p, k))).collect();
        let read = |&(pair, k): &(&Pair, usize)| {
            self.shapes.picture(pair.class, pair.shape, pair.views[k])
        };
        let pictures = seen.par_iter().map(read).collect::<anyhow::Result<Vec<_>>>()?;
        let views = seen.iter().map(|&(pair, k)| pair.views[k]).collect();
        Ok(PairBatch { pictures: tensor(&pictures, device), views })
    }
}

/// Pictures of pairs: first all first views, then all second views.
#[derive(Clone, Debug)]
pub(crate) struct PairBatch<B: Backend> {
    /// `[2 pairs, 4, 64, 64]`, 0 to 1.
    pub(crate) pictures: Tensor<B, 4>,
    /// View of each picture, `[2 pairs]`.
    pub(crate) views: Vec<usize>,
}

/// Pictures as one tensor `[pictures, 4, 64, 64]`, 0 to 1.
pub(crate) fn tensor<B: Backend>(pictures: &[Vec<u8>], device: &B::Device) -> Tensor<B, 4> {
    let values: Vec<f32> = pictures.iter().flatten().map(|&byte| f32::from(byte) / 255.0).collect();
    let data = TensorData::new(values, [pictures.len(), 4, SIZE, SIZE]);
    Tensor::from_data(data, (device, <B::FloatElem as Element>::dtype()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Procedural, Split};

    #[test]
    fn pairs_cover_classes_and_views_and_change_from_epoch_to_epoch() {
        let shapes: Arc<dyn Shapes> = Arc::new(Procedural::new(Split::Train, 0, 7));
        let of = |epoch| Pairs { shapes: shapes.clone(), seed: 1, epoch };
        let first = |epoch| (0..500).map(|k| of(epoch).get(k)).collect::<Vec<_>>();
        let pairs = first(0);
        assert_eq!(pairs, first(0));
        assert_ne!(pairs, first(1));
        for class in 0..5 {
            assert!(pairs.iter().filter(|pair| pair.class == class).count() > 60);
        }
        assert!((0..VIEWS).all(|view| pairs.iter().any(|pair| pair.views[1] == view)));
    }
}
