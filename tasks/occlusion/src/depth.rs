use anyhow::ensure;
use softrast_cli::{EdgeChoice, PRESET, Schedule, Searched};
use softrast_inverse::{DepthSoftnessFile, NameOrFile};
use softrast_lab::Error;
use softrast_raster::HostBackend;
use softrast_softness::{DepthSoftness, Family};
use softrast_tensor::{numbers, tensor, vector};

use crate::{Args, args::NAME};

/// Default width of the depth softness, in units of the distance between the planes.
///
/// Narrower widths have vanishing gradients at a wrong order; wider ones let hidden quads shine through. Success of 50
/// seeds with `evaluate --runs 50 --size 32 --depth-scale X`, original and transfer: 98 and 98 % at 0.05, 100 and 100 %
/// at 0.1, 100 and 98 % at 0.2, 100 and 90 % at 0.4; 88 % at 0.02 (original).
const DEPTH_SCALE: f64 = 0.1;

/// A depth softness with its parameters, fixed over a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Depth {
    pub(crate) softness: DepthSoftness,
    pub(crate) phi: Vec<f64>,
    /// Name of the softness or of the file.
    pub(crate) name: String,
    /// The width, if the parameters were derived from it.
    pub(crate) scale: Option<f64>,
}

impl Depth {
    /// The depth softness of the command line; by default the one bundled with the edge softness in
    /// use, else the family of the edges, and for the network of Eq. 2 that of Eq. 3.
    ///
    /// # Errors
    ///
    /// If a file cannot be used, flags contradict each other, or weights are not finite.
    pub(crate) fn new(args: &Args, edges: &EdgeChoice) -> anyhow::Result<Self> {
        let softness = match &args.depth_softness {
            Some(NameOrFile::File(path)) => {
                if args.depth_scale.is_some() {
                    return Err(usage("a depth softness file holds its own parameters"));
                }
                let file = DepthSoftnessFile::load(path)?;
                return Self::from_file(path.display().to_string(), file);
            }
            Some(NameOrFile::Name(softness)) => *softness,
            None => match bundled(args, edges) {
                Some((name, file)) => return Self::from_file(name.to_owned(), file),
                None => like_edges(edges),
            },
        };
        let name = softness.name().to_owned();
        if softness == DepthSoftness::Mlp {
            if args.depth_scale.is_some() {
                return Err(usage("depth_mlp has no scale"));
            }
            return Ok(Self { softness, phi: softness.default_phi(1.0), name, scale: None });
        }
        let searched = Searched::of(NAME, softness.name(), edges.schedule, Schedule::Static);
        let searched = searched.and_then(|found| found.depth_scale);
        let scale = args.depth_scale.or(searched).unwrap_or(DEPTH_SCALE);
        Self { softness, phi: softness.default_phi(scale), name, scale: Some(scale) }.checked()
    }

    fn from_file(name: String, file: DepthSoftnessFile) -> anyhow::Result<Self> {
        let DepthSoftnessFile { depth_softness, phi, .. } = file;
        Self { softness: depth_softness, phi, name, scale: None }.checked()
    }

    /// The largest ratio of two depth weights, as a logarithm; 0 if all depths have equal weight.
    pub(crate) fn contrast(&self) -> f64 {
        let weights = || self.log_weights(&self.phi).into_iter().map(|[_, weight]| weight);
        weights().fold(f64::NEG_INFINITY, f64::max) - weights().fold(f64::INFINITY, f64::min)
    }

    fn checked(self) -> anyhow::Result<Self> {
        let finite = self.log_weights(&self.phi).iter().all(|[_, weight]| weight.is_finite());
        ensure!(finite, "depth softness {:?}: its weights are not finite numbers", self.name);
        Ok(self)
    }

    /// Logarithms of the weights over the nearness, from the far plane to the near one, in the program's float type.
    pub(crate) fn log_weights(&self, phi: &[f64]) -> Vec<[f64; 2]> {
        const PLACES: usize = 100;
        let places: Vec<f64> = (0..=PLACES).map(|k| k as f64 / PLACES as f64).collect();
        let at = tensor::<HostBackend, 1>(places.clone(), [PLACES + 1]);
        let weights = numbers(self.softness.log_weight(vector(phi), at));
        places.into_iter().zip(weights).map(|(near, weight)| [near, weight]).collect()
    }
}

/// The depth softness bundled with the edge softness, if that is in use, and its name.
fn bundled(args: &Args, edges: &EdgeChoice) -> Option<(&'static str, DepthSoftnessFile)> {
    let edge_name = edges.bundled.as_ref().filter(|_| args.depth_scale.is_none())?;
    let (name, file) = match edge_name.as_str() {
        PRESET => (PRESET, DepthSoftnessFile::preset(NAME)),
        name => ("learned", DepthSoftnessFile::learned(name)),
    };
    Some((name, file.ok()?))
}

fn like_edges(edges: &EdgeChoice) -> DepthSoftness {
    match edges.family {
        Some(Family::Mlp) => DepthSoftness::Mlp,
        Some(family) => DepthSoftness::Family(family),
        None => DepthSoftness::Family(Family::Logistic),
    }
}

fn usage(what: &str) -> anyhow::Error {
    Error::usage(format!("{what}: leave out --depth-scale, or name a family"))
}
