use burn::tensor::{Tensor, backend::Backend};

use crate::Resolution;

/// A target image at every size that a run may draw at: its own and, averaged over areas, each
/// half of the one before as long as that is a whole number.
#[derive(Clone, Debug)]
pub struct Targets<B: Backend> {
    /// `[views, size, size]`, the largest first.
    levels: Vec<Tensor<B, 3>>,
}

impl<B: Backend> Targets<B> {
    /// All sizes of `target` `[views, size, size]`.
    pub fn new(target: Tensor<B, 3>) -> Self {
        let [_, size, _] = target.dims();
        let smaller = Resolution::sides(size).skip(1);
        let levels = smaller.fold(vec![target], |mut levels, _| {
            let next = halved(levels[levels.len() - 1].clone());
            levels.push(next);
            levels
        });
        Self { levels }
    }

    /// The target as it was given.
    pub fn full(&self) -> Tensor<B, 3> {
        self.levels[0].clone()
    }

    /// The target at all sizes, the largest first.
    pub fn levels(&self) -> &[Tensor<B, 3>] {
        &self.levels
    }

    /// The target for an `image` `[views, side, side]`.
    ///
    /// # Panics
    ///
    /// If the image has another size than all of them.
    pub fn of(&self, image: &Tensor<B, 3>) -> Tensor<B, 3> {
        self.of_side(image.dims()[1])
    }

    /// The target of `side` pixels a side.
    ///
    /// # Panics
    ///
    /// If there is none.
    pub fn of_side(&self, side: usize) -> Tensor<B, 3> {
        let level = self.levels.iter().find(|level| level.dims()[1] == side);
        level.cloned().unwrap_or_else(|| panic!("there is no target of {side} pixels a side"))
    }
}

/// Means of two by two pixels: `[views, size, size]` to `[views, size / 2, size / 2]`.
fn halved<B: Backend>(image: Tensor<B, 3>) -> Tensor<B, 3> {
    let [views, size, _] = image.dims();
    let half = size / 2;
    let across = image.reshape([views, size, half, 2]).mean_dim(3);
    across.reshape([views, half, 2, half]).mean_dim(2).reshape([views, half, half])
}

#[cfg(test)]
mod tests {
    use softrast_raster::HostBackend;

    use super::*;
    use softrast_softness::{numbers, tensor};

    #[test]
    fn a_smaller_target_has_the_means_of_areas() {
        let image =
            vec![0.0, 1.0, 0.5, 0.5, 1.0, 0.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0];
        let image = tensor::<HostBackend, 3>(image, [1, 4, 4]);
        let targets = Targets::new(image.clone());
        let at = |side| numbers(targets.of(&Tensor::zeros([1, side, side], &Default::default())));
        assert_eq!(at(4), numbers(image.clone()));
        assert_eq!(at(2), [0.5, 0.375, 1.0, 0.25]);
        assert_eq!(at(1), numbers(image.mean()));
    }

    #[test]
    #[should_panic(expected = "no target of 2 pixels")]
    fn a_size_that_is_no_half_of_a_half_has_no_target() {
        let targets = Targets::new(Tensor::<HostBackend, 3>::zeros([2, 6, 6], &Default::default()));
        let _ = targets.of(&Tensor::zeros([2, 3, 3], &Default::default()));
        let _ = targets.of(&Tensor::zeros([2, 2, 2], &Default::default()));
    }
}
