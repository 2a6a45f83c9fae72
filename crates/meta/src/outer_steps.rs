use serde::{Deserialize, Serialize};

/// The steps of an inner loop after which the outer loss is taken; their mean counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OuterSteps {
    /// After the last step alone, as in the paper.
    #[default]
    Last,
    /// After a quarter, half and all of the steps: rewards being fast, and is less short-sighted than
    /// the end of a short loop. Not in the paper. Source:
    /// docs/notes.md, Meta-gradients: outer loop.
    Quarters,
}

impl OuterSteps {
    /// How many steps are done when the loss is taken, in ascending order, of a loop of `steps`.
    pub(crate) fn at(self, steps: usize) -> Vec<usize> {
        let mut at = match self {
            OuterSteps::Last => vec![steps],
            OuterSteps::Quarters => [4, 2, 1].map(|part| (steps / part).max(1).min(steps)).into(),
        };
        at.dedup();
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_loops_are_measured_at_fewer_steps() {
        assert_eq!(OuterSteps::Quarters.at(100), [25, 50, 100]);
        assert_eq!(OuterSteps::Quarters.at(3), [1, 3]);
        assert_eq!(OuterSteps::Quarters.at(1), [1]);
        assert_eq!(OuterSteps::Quarters.at(0), [0]);
        assert_eq!(OuterSteps::Last.at(7), [7]);
    }
}
