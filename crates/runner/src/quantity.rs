use crate::{Description, ErrorGroup, Measure, Score, task::Point};

/// One of the numbers that every [`Point`] brings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Loss,
    ImageError,
    ParameterError,
    /// Place in [`Description::extra`].
    Extra(usize),
}

impl Quantity {
    /// The loss and all errors.
    pub(crate) fn all(description: &Description) -> Vec<Self> {
        let main = [Quantity::Loss, Quantity::ImageError, Quantity::ParameterError];
        let extra = (0..description.extra.len()).map(Quantity::Extra);
        main.into_iter().chain(extra).collect()
    }

    /// What a chart shows: both main errors, and the score if it is neither.
    pub(crate) fn shown(description: &Description, score: Score) -> Vec<Self> {
        let mut shown = vec![Quantity::ImageError, Quantity::ParameterError];
        let score = Self::score(description, score);
        if !shown.contains(&score) {
            shown.insert(0, score);
        }
        shown
    }

    /// The error by which settings are compared.
    ///
    /// # Panics
    ///
    /// If the score names a further error that the description does not have.
    pub(crate) fn score(description: &Description, score: Score) -> Self {
        match score {
            Score::Image => Quantity::ImageError,
            Score::Parameter => Quantity::ParameterError,
            Score::Extra(key) => {
                let place = description.extra.iter().position(|extra| extra.key == key);
                Quantity::Extra(
                    place.unwrap_or_else(|| panic!("no further error is named {key:?}")),
                )
            }
        }
    }

    /// The main error of a group, and the further ones of that group with their keys.
    pub(crate) fn group(
        group: ErrorGroup,
        description: &Description,
    ) -> (Self, Vec<(&'static str, Self)>) {
        let main = match group {
            ErrorGroup::Image => Quantity::ImageError,
            ErrorGroup::Parameter => Quantity::ParameterError,
        };
        let extra = description.extra.iter().enumerate().filter(|(_, extra)| extra.group == group);
        (main, extra.map(|(place, extra)| (extra.key, Quantity::Extra(place))).collect())
    }

    /// Its value.
    pub(crate) fn of(self, point: &Point) -> f64 {
        match self {
            Quantity::Loss => point.loss,
            Quantity::ImageError => point.image_error,
            Quantity::ParameterError => point.parameter_error,
            Quantity::Extra(place) => point.extra[place],
        }
    }

    /// Name of its column in a table, such as `image_error_hard`.
    pub(crate) fn column(self, description: &Description) -> String {
        match self {
            Quantity::Loss => "loss".into(),
            Quantity::ImageError => "image_error".into(),
            Quantity::ParameterError => "parameter_error".into(),
            Quantity::Extra(place) => {
                let extra = &description.extra[place];
                let group = match extra.group {
                    ErrorGroup::Image => "image",
                    ErrorGroup::Parameter => "parameter",
                };
                format!("{group}_error_{}", extra.key)
            }
        }
    }

    /// Name and unit.
    pub(crate) fn measure(self, description: &Description) -> Measure {
        match self {
            Quantity::Loss => Measure { name: "loss", unit: "" },
            Quantity::ImageError => description.image_error,
            Quantity::ParameterError => description.parameter_error,
            Quantity::Extra(place) => description.extra[place].measure,
        }
    }
}
