use crate::TaskName;

/// A figure of the paper's Table 3: image error and parameter error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Image error, in the paper's unit.
    pub image: f64,
    /// Parameter error; 2D SHAPE has none.
    pub parameter: Option<f64>,
}

/// Figures of a method: 2D SHAPE, 3D SHAPE, POSE, OCCLUSION, each original and transfer.
type Row = [[f64; 2]; 8];

/// Not a number: nothing is printed.
const NONE: f64 = f64::NAN;

/// Source: Wu et al. 2024, Table 3. Its row of the logistic has no label (FACTS 5.3).
const ROWS: [(&str, Row); 5] = [
    (
        "mlp",
        [
            [0.0038, NONE],
            [0.0038, NONE],
            [19.4, 3.2],
            [69.0, 4.72],
            [1.1, 0.01],
            [2.17, 0.14],
            [0.041, 0.244],
            [0.040, 1.63],
        ],
    ),
    (
        "gauss",
        [
            [0.0046, NONE],
            [0.0187, NONE],
            [31.2, 11.9],
            [79.0, 4.49],
            [15.3, 0.19],
            [15.98, 0.14],
            [0.049, 0.962],
            [0.058, 7.63],
        ],
    ),
    (
        "logistic",
        [
            [0.0056, NONE],
            [0.0179, NONE],
            [29.8, 10.1],
            [97.0, 4.54],
            [16.2, 0.22],
            [16.63, 0.12],
            [0.048, 0.916],
            [0.055, 7.51],
        ],
    ),
    (
        "exp",
        [
            [0.0054, NONE],
            [0.0148, NONE],
            [32.0, 11.3],
            [87.0, 4.35],
            [15.9, 0.18],
            [14.98, 0.15],
            [0.049, 0.627],
            [0.046, 1.40],
        ],
    ),
    (
        "gamma",
        [
            [0.0056, NONE],
            [0.0204, NONE],
            [28.7, 10.0],
            [86.0, 4.58],
            [14.5, 0.24],
            [15.14, 0.24],
            [0.049, 0.627],
            [0.046, 1.40],
        ],
    ),
];

impl Printed {
    /// The figure of a method; none for one that the paper does not have.
    pub fn of(task: TaskName, variant: &str, method: &str) -> Option<Self> {
        let (_, row) = ROWS.into_iter().find(|(name, _)| *name == method)?;
        let place = TaskName::ALL.into_iter().position(|other| other == task)?;
        let [image, parameter] = row[2 * place + usize::from(variant == "transfer")];
        Some(Self { image, parameter: (!parameter.is_nan()).then_some(parameter) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_stand_where_the_paper_has_them() {
        let found = Printed::of(TaskName::Pose, "original", "gauss");
        assert_eq!(found, Some(Printed { image: 15.3, parameter: Some(0.19) }));
        let found = Printed::of(TaskName::Shape2d, "transfer", "gamma");
        assert_eq!(found, Some(Printed { image: 0.0204, parameter: None }));
        assert_eq!(
            Printed::of(TaskName::Occlusion, "transfer", "exp").map(|p| p.image),
            Some(0.046)
        );
        assert_eq!(Printed::of(TaskName::Pose, "original", "laplace"), None);
    }
}
