//! Coefficients of a lens that distorts.

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use serde_json::Value;

use super::{Distortion, fields::short};

/// Coefficients by name, or as a list.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub(super) struct Coefficients {
    /// In the order of OpenCV: k1, k2, p1, p2, k3 to k6; those of a fisheye are k1 to k4.
    #[serde(alias = "dist", alias = "dist_coeffs", alias = "distortion_coefficients")]
    distortion: Option<Value>,
    /// In the order of nerfstudio: k1 to k4, p1, p2.
    distortion_params: Option<Value>,
    is_fisheye: Option<bool>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// Names of coefficients in the order of OpenCV's list, and in that of nerfstudio's.
const OPENCV: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
const NERFSTUDIO: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];
/// Camera models without distortion except by their coefficients, and fisheye models.
const STRAIGHT: [&str; 8] = [
    "PINHOLE",
    "SIMPLE_PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "FULL_OPENCV",
    "BROWN",
    "PERSPECTIVE",
];
const FISHEYES: [&str; 4] =
    ["OPENCV_FISHEYE", "FISHEYE", "RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE"];
impl Coefficients {
    /// The distortion with these coefficients and a model of this name; `None` if there is none.
    pub(super) fn distortion(&self, model: Option<&str>) -> anyhow::Result<Option<Distortion>> {
        let model = model.unwrap_or("OPENCV").to_ascii_uppercase();
        let fisheye = self.is_fisheye.unwrap_or(false) || FISHEYES.contains(&&*model);
        ensure!(
            fisheye || STRAIGHT.contains(&&*model),
            "the camera model {} is not supported, but {} and {} are: undistort the pictures, as with colmap image_undistorter",
            short(&model),
            STRAIGHT.join(", "),
            FISHEYES.join(", ")
        );
        let order: &[&str] = if fisheye { &["k1", "k2", "k3", "k4"] } else { &OPENCV };
        let lists = [(&self.distortion, order), (&self.distortion_params, &NERFSTUDIO[..])];
        let mut listed = Vec::new();
        for (list, names) in lists {
            let Some(list) = list else { continue };
            let numbers = numbers(list).with_context(|| format!("distortion is {list}"))?;
            if let Some(x) = numbers.iter().skip(names.len()).find(|&&x| x != 0.0) {
                bail!(
                    "the lens has more coefficients than {}, one of them {x}: they are not supported",
                    names.join(", ")
                );
            }
            listed.extend(names.iter().copied().zip(numbers));
        }
        let Self { k1, k2, k3, k4, k5, k6, p1, p2, .. } = *self;
        let named = [k1, k2, p1, p2, k3, k4, k5, k6];
        let of = |name: &str, named: Option<f64>| {
            let listed = || listed.iter().find(|(of, _)| *of == name).map(|&(_, x)| x);
            named.or_else(listed).unwrap_or(0.0)
        };
        let mut all = [0.0; 8];
        for (k, value) in all.iter_mut().enumerate() {
            *value = of(OPENCV[k], named[k]);
        }
        ensure!(all.iter().all(|x| x.is_finite()), "a coefficient of the lens is not finite");
        let [k1, k2, p1, p2, k3, k4, k5, k6] = all;
        if fisheye {
            ensure!(
                [p1, p2, k5, k6] == [0.0; 4],
                "a fisheye has the coefficients k1 to k4 alone, and here are others"
            );
            return Ok(Some(Distortion::Fisheye { k: [k1, k2, k3, k4] }));
        }
        // The k4 of nerfstudio multiplies r⁸.
        ensure!(
            k4 == 0.0 || self.distortion_params.is_none() || self.k4.is_some(),
            "distortion_params has a fourth coefficient {k4}, which is not supported"
        );
        let bends = all != [0.0; 8];
        Ok(bends.then_some(Distortion::Rational { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] }))
    }

    /// These coefficients, and those of `other` where one is absent.
    pub(super) fn or(&self, other: &Self) -> Self {
        Self {
            distortion: self.distortion.clone().or(other.distortion.clone()),
            distortion_params: self.distortion_params.clone().or(other.distortion_params.clone()),
            is_fisheye: self.is_fisheye.or(other.is_fisheye),
            k1: self.k1.or(other.k1),
            k2: self.k2.or(other.k2),
            k3: self.k3.or(other.k3),
            k4: self.k4.or(other.k4),
            k5: self.k5.or(other.k5),
            k6: self.k6.or(other.k6),
            p1: self.p1.or(other.p1),
            p2: self.p2.or(other.p2),
        }
    }
}

/// The numbers of a list, of nested lists, or of the `data` of an OpenCV matrix, in order.
fn numbers(value: &Value) -> anyhow::Result<Vec<f64>> {
    match value {
        Value::Array(values) => {
            let all = values.iter().map(numbers).collect::<anyhow::Result<Vec<_>>>()?;
            Ok(all.concat())
        }
        Value::Object(fields) => numbers(fields.get("data").context("no data in it")?),
        other => Ok(vec![other.as_f64().context("that is no list of numbers")?]),
    }
}
