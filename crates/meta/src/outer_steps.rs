use serde::{Deserialize, Serialize};

/// The inner steps after which the outer loss is evaluated; their mean counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OuterSteps {
    /// After the last step only, as in the paper.
    #[default]
    Last,
    /// After a quarter, half and all of the steps: rewards speed, with less short-horizon bias than
    /// the end of a short loop. Not in the paper. Source: docs/notes.md, Meta-gradients: outer
    /// loop.
    Quarters,
}

impl OuterSteps {
    /// Numbers of completed steps at which the loss is evaluated, ascending, in a loop of `steps`.
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
