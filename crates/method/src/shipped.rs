use std::path::Path;

use softrast_softness::{SoftnessFile, SoftnessFileError};

/// What was learned for each task, as it stands in `data/softness`; each file says in its note how.
const FILES: [(&str, &str); 0] = [];

/// A learned softness that comes with the programs.
///
/// `name` is that of its file in `data/softness` without the ending, such as `pose`; none if there is
/// no such file.
///
/// # Errors
///
/// If the file is not what a softness file holds.
pub fn shipped(name: &str) -> Result<Option<SoftnessFile>, SoftnessFileError> {
    let found = FILES.iter().find(|(known, _)| *known == name);
    found.map(|(name, text)| SoftnessFile::parse(Path::new(name), text)).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shipped_can_be_used() {
        for (name, _) in FILES {
            let file = shipped(name).unwrap().unwrap();
            assert!(file.note.is_some(), "{name} does not say how it was learned");
        }
        assert_eq!(shipped("teapot").unwrap(), None);
    }
}
