//! Failure modes of colours: a hidden surface shows through, or gets no gradient.

use pose::{Args, Range, colour::Coloured};
use softrast_mesh::icosphere;
use softrast_raster::{Attributes, ColourRenderer, Projected, Weighting, mse_loss};
use softrast_softness::{DepthSoftness, Family};
use softrast_tensor::{Autodiff, Tensor, numbers, tensor};

use super::common::{ORIGINAL, PARAMETER, SCALE, levels, trials};
use crate::{
    Case, Config, Level, Tested, Trial,
    drawing::{Single, largest},
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "F24",
        name: "colour of what is hidden",
        scene: "a square of two triangles before another of another colour, 24 x 24, depth softness at its default scale",
        perturbation: "gap between the two, 0.01 to 1 of the distance between the planes",
        measure: "largest share of the hidden colour, four pixels and more inside",
        target: "at most 0.05",
        run: hidden,
    },
    Case {
        id: "G08",
        name: "gradient of what is hidden",
        scene: "as F24, and a picture that shows the hidden colour",
        perturbation: "gap between the two, 0.01 to 1 of the distance between the planes",
        measure: "1 unless the loss falls as the hidden square comes nearer",
        target: "0",
        run: gradient_of_depth,
    },
    Case {
        id: "O33",
        name: "POSE by colour, by range of the starts",
        scene: "POSE by colour, a ball whose silhouette tells nothing, 24 x 24, 80 steps of 1, one start, 8 seeds",
        perturbation: "starts 15-35, 35-55 and 55-75 degrees away",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: ball,
    },
];

const SIDE: usize = 24;
/// Distance from the border of the squares, in pixels, from which on pixels count as inside.
const INSIDE: usize = 4;
const PLANES: [f64; 2] = [1.0, 4.0];
const GAPS: [f64; 8] = [0.01, 0.03, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0];

/// Share of the hidden square in each pixel, and gradients with respect to the corners, `[8, 3]`, of the mean squared difference to a
/// picture of that square alone.
fn two_squares(tested: &Tested, gap: f64) -> [Vec<f64>; 2] {
    let softness = tested.at(SCALE);
    let depth = DepthSoftness::Family(Family::Exp);
    let phi = [softness.phi_at(1.0, SIDE), depth.default_phi(ColourRenderer::DEPTH_SCALE)];
    let weighting = Weighting { edge: softness.softness, depth, planes: PLANES };
    let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let renderer = ColourRenderer::with_weighting(faces.into(), SIDE, weighting, phi);
    let [near, far] = PLANES;
    let square = |depth: f64| {
        [[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]].map(|[x, y]| [x, y, depth])
    };
    let corners = [square(near), square(near + gap * (far - near))].concat().concat();
    let corners = tensor::<Single, 3>(corners, [1, 8, 3]);
    let corners = Tensor::<Autodiff<Single>, 3>::from_inner(corners).require_grad();
    let hidden = Tensor::from_inner(tensor::<Single, 3>([[0.0; 4], [1.0; 4]].concat(), [1, 8, 1]));
    let background = renderer.background(&[0.0], &corners.device());
    let image = renderer.image(
        Projected::new(corners.clone()),
        &Attributes::of_vertices(hidden, &faces),
        &background,
    );
    let share = image.narrow(1, 0, 1).reshape([1, SIDE, SIDE]);
    let loss = mse_loss(share.clone(), share.ones_like()).sum();
    let gradient = corners.grad(&loss.backward()).map(numbers).unwrap_or_default();
    [numbers(share.inner()), gradient]
}

fn hidden(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let border = (0.1 * SIDE as f64).ceil() as usize + INSIDE;
    let is_inside = |k: &usize| (border..SIDE - border).contains(k);
    levels(GAPS, |gap: f64| {
        let [share, _] = two_squares(tested, gap);
        let inside = (0..SIDE)
            .filter(is_inside)
            .flat_map(|y| (0..SIDE).filter(is_inside).map(move |x| y * SIDE + x));
        let most = largest(inside.map(|k| share[k]));
        Ok(Level::new(gap, vec![Trial::at_most(most, 0.05).with(&share)]))
    })
}

fn gradient_of_depth(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels(GAPS, |gap: f64| {
        let [share, gradient] = two_squares(tested, gap);
        let by_depth: f64 = (4..8).map(|corner| gradient[3 * corner + 2]).sum();
        Ok(Level::new(gap, vec![Trial::holds(by_depth > 0.0).with(&share).with(&gradient)]))
    })
}

fn ball(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let ball = icosphere(2);
    let colours = ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * (2.0 * x).sin()));
    let ball = ball.clone().with_colours(colours.collect())?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("ball.ply");
    ball.save(&path)?;
    let config =
        Config { size: SIDE, steps: Some(80), learning_rate: Some(1.0), runs: 8, ..ORIGINAL };
    levels([Range::Near, Range::Middle, Range::Far], |range: Range| {
        let args = Args {
            colour: true,
            mesh: Some(path.clone()),
            raw: true,
            range: Some(range),
            ..Args::default()
        };
        Ok(Level::named(range.name(), trials::<Coloured>(tested, args, &config, PARAMETER)?))
    })
}
