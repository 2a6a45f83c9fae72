use rand::{SeedableRng, rngs::StdRng};

use crate::{Shapes, Split, Voxels, kinds, solid::Solid, view};

/// Random shapes that are generated on demand: any number of them, without memory.
///
/// Five classes: airplanes, cars, chairs, lamps and tables. Not in the paper, which learns from 13
/// classes of `ShapeNet`: this set needs no download.
#[derive(Clone, Debug)]
pub struct Procedural {
    classes: Vec<String>,
    split: Split,
    seed: u64,
    per_class: usize,
}

impl Procedural {
    /// `per_class` shapes of every class; splits and seeds have different shapes.
    ///
    /// # Panics
    ///
    /// If `per_class` is 0.
    pub fn new(split: Split, seed: u64, per_class: usize) -> Self {
        assert!(per_class > 0, "a class needs shapes");
        let classes = kinds::KINDS.map(|(name, _)| name.to_owned()).to_vec();
        Self { classes, split, seed, per_class }
    }

    fn solid(&self, class: usize, shape: usize) -> Solid {
        let parts = [self.seed, self.split as u64, class as u64, shape as u64];
        // A different stream for each shape: the generator's own seeding mixes the bits of every part.
        let mut seed = [0; 32];
        for (bytes, part) in seed.chunks_mut(8).zip(parts) {
            bytes.copy_from_slice(&part.to_le_bytes());
        }
        kinds::solid(class, &mut StdRng::from_seed(seed))
    }
}

impl Shapes for Procedural {
    fn classes(&self) -> &[String] {
        &self.classes
    }

    fn count(&self, _class: usize) -> usize {
        self.per_class
    }

    fn picture(&self, class: usize, shape: usize, view: usize) -> anyhow::Result<Vec<u8>> {
        Ok(view::picture(&self.solid(class, shape), view))
    }

    fn voxels(&self, class: usize, shape: usize) -> anyhow::Result<Voxels> {
        let solid = self.solid(class, shape);
        Ok(Voxels::of_solid(|p| solid.distance(p) < 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_is_the_same_every_time_and_no_other() {
        let [train, test] = [Split::Train, Split::Test].map(|split| Procedural::new(split, 3, 9));
        for class in 0..5 {
            let shape = train.solid(class, 4);
            assert_eq!(shape, train.solid(class, 4));
            assert_ne!(shape, train.solid(class, 5));
            assert_ne!(shape, test.solid(class, 4));
            assert_ne!(shape, Procedural::new(Split::Train, 4, 9).solid(class, 4));
        }
    }
}
