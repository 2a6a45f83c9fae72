//! Numbers as text in JSON, because `serde_json` reads them with the last digit off unless a feature is
//! on that all its users would have to compile.

pub(crate) mod vector {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

    pub(crate) fn serialize<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
        values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ").serialize(to)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<f64>, D::Error> {
        let text = String::deserialize(from)?;
        let number = |word: &str| {
            word.parse().map_err(|_| D::Error::custom(format!("{word:?} is not a number")))
        };
        text.split_whitespace().map(number).collect()
    }
}

pub(crate) mod number {
    use serde::{Deserializer, Serializer, de::Error as _};

    pub(crate) fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        super::vector::serialize(&[*value], to)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<f64, D::Error> {
        let values = super::vector::deserialize(from)?;
        let [value] = values[..] else {
            return Err(D::Error::custom(format!("{} numbers, expected one", values.len())));
        };
        Ok(value)
    }
}
