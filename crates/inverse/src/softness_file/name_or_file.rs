use std::{fmt, path::PathBuf, str::FromStr};

/// A softness on a command line, `NAME|FILE.json`: a [`Family`](softrast_softness::Family) or a
/// [`DepthSoftness`](softrast_softness::DepthSoftness) by its name, or a file.
///
/// ```
/// use softrast_inverse::NameOrFile;
/// use softrast_softness::Family;
///
/// assert_eq!("gauss".parse(), Ok(NameOrFile::Name(Family::Gauss)));
/// assert_eq!("own.json".parse(), Ok(NameOrFile::<Family>::File("own.json".into())));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NameOrFile<T> {
    /// A name.
    Name(T),
    /// A file, not opened yet. Its name ends in `.json`.
    File(PathBuf),
}

impl<T: FromStr<Err: fmt::Display>> FromStr for NameOrFile<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.to_ascii_lowercase().ends_with(".json") {
            return Ok(Self::File(text.into()));
        }
        let named = text.parse().map(Self::Name);
        named.map_err(|unknown| format!("{unknown}; or a file that ends in .json"))
    }
}

#[cfg(test)]
mod tests {
    use softrast_softness::{DepthSoftness, Family};

    use super::*;

    #[test]
    fn what_ends_in_json_is_a_file_and_all_else_a_name() {
        assert_eq!("gauss".parse(), Ok(NameOrFile::Name(Family::Gauss)));
        assert_eq!("depth_mlp".parse(), Ok(NameOrFile::Name(DepthSoftness::Mlp)));
        assert_eq!("a/B.JSON".parse(), Ok(NameOrFile::<Family>::File("a/B.JSON".into())));
        let message = "soft".parse::<NameOrFile<Family>>().unwrap_err();
        assert!(
            message.starts_with("unknown softness \"soft\"; known are logistic, "),
            "{message}"
        );
        assert!(message.ends_with("; or a file that ends in .json"), "{message}");
    }
}
