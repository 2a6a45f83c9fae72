//! Failure modes of OCCLUSION: too few steps, another depth softness, many quads.

use occlusion::{Args, Occlusion};
use softrast_cli::Variant;

use super::common::{ORIGINAL, PARAMETER, levels, trials};
use crate::{Case, Config, Level, Tested};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O13",
        name: "OCCLUSION by steps",
        scene: "OCCLUSION, 3 quads, 24 x 24, 10 seeds",
        perturbation: "10, 30 and 100 steps",
        measure: "share of pairs of quads in the wrong order",
        target: "0",
        run: steps,
    },
    Case {
        id: "O14",
        name: "OCCLUSION by depth softness",
        scene: "OCCLUSION, 3 quads, 24 x 24, 60 steps, 10 seeds",
        perturbation: "scale of the depth from 1e-3 to 10 (of no effect on the network)",
        measure: "share of pairs of quads in the wrong order",
        target: "0",
        run: depth_scales,
    },
    Case {
        id: "O23",
        name: "OCCLUSION, eight quads",
        scene: "OCCLUSION, transfer: 8 quads, 10 steps, 24 x 24, 10 seeds",
        perturbation: "learning rate from 0.07 to 7",
        measure: "1 if the front quad is wrong",
        target: "0",
        run: eight,
    },
];

/// Index of the share of wrong front quads.
const FRONT: usize = 5;

const SOLVED: Config = Config { size: 24, runs: 10, ..ORIGINAL };

fn steps(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([10, 30, 100], |steps: usize| {
        let config = Config { steps: Some(steps), ..SOLVED };
        let trials = trials::<Occlusion>(tested, Args::default(), &config, PARAMETER)?;
        Ok(Level::new(steps as f64, trials))
    })
}

fn depth_scales(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-3, 1e-2, 0.1, 1.0, 10.0], |scale: f64| {
        let args =
            Args { depth_scale: Some(scale).filter(|_| !tested.is_network()), ..Args::default() };
        let config = Config { steps: Some(60), ..SOLVED };
        Ok(Level::new(scale, trials::<Occlusion>(tested, args, &config, PARAMETER)?))
    })
}

fn eight(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([0.07, 0.2, 0.7, 2.0, 7.0], |rate: f64| {
        let config = Config { variant: Variant::Transfer, learning_rate: Some(rate), ..SOLVED };
        let trials = trials::<Occlusion>(tested, Args::default(), &config, FRONT)?;
        Ok(Level::new(rate, trials))
    })
}
