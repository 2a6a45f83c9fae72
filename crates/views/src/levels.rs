use std::sync::Arc;

/// Levels of a channel from 0 to 1. Copies share them.
#[derive(Clone, Debug)]
pub(crate) enum Levels {
    /// Multiples of 1 / [`Levels::MOST`], as files of 8 and 16 bits have.
    Sixteen(Arc<[u16]>),
    Floats(Arc<[f32]>),
}

impl Levels {
    /// White, in steps.
    pub(crate) const MOST: f32 = 65535.0;

    /// Keeps these numbers, in 16 bits if all fit.
    pub(crate) fn of(levels: &[f32]) -> Self {
        // A float out of range saturates, and then differs from the level.
        let steps: Arc<[u16]> = levels.iter().map(|x| (x * Self::MOST).round() as u16).collect();
        match levels.iter().zip(&*steps).all(|(&level, &steps)| level == of_steps(steps)) {
            true => Self::Sixteen(steps),
            false => Self::Floats(levels.into()),
        }
    }

    pub(crate) fn at(&self, pixel: usize) -> f32 {
        match self {
            Self::Sixteen(steps) => of_steps(steps[pixel]),
            Self::Floats(levels) => levels[pixel],
        }
    }
}

fn of_steps(steps: u16) -> f32 {
    f32::from(steps) / Levels::MOST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_files_take_two_bytes_and_none_changes() {
        let of = |levels: Vec<f32>| {
            let kept = Levels::of(&levels);
            assert!(levels.iter().enumerate().all(|(k, &level)| kept.at(k) == level));
            matches!(kept, Levels::Sixteen(_))
        };
        assert!(of((0..=255u8).map(|x| f32::from(x) / 255.0).collect()));
        assert!(of((0..=65535u16).map(|x| f32::from(x) / 65535.0).collect()));
        assert!(!of(vec![0.0, 0.3, 1.0]));
        assert!(!of(vec![0.0, -0.1]));
        assert!(!of(vec![1.0, 1.5]));
    }
}
