//! Picture names in camera files, and the corresponding files.

use std::path::{Path, PathBuf};

/// Extensions of picture files.
const ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "gif"];

/// The file of a name in a camera file: the first that exists, or else the likeliest, for an error.
pub(super) fn picture_path(folder: &Path, name: &str) -> PathBuf {
    let ending = |name: &str| name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    let complete = ending(name).is_some_and(|ending| ENDINGS.contains(&&*ending));
    let mut candidates = Vec::new();
    for name in spellings(name) {
        candidates.push(folder.join(&name));
        if !complete {
            let endings =
                ENDINGS.iter().flat_map(|ending| [ending.to_string(), ending.to_uppercase()]);
            candidates.extend(endings.map(|ending| folder.join(format!("{name}.{ending}"))));
        }
    }
    let found = candidates.iter().position(|path| path.is_file());
    candidates.swap_remove(found.unwrap_or(usize::from(!complete)))
}

/// The name itself, with the separators of Windows replaced, and if it starts with a drive of Windows its suffixes, the longest first.
fn spellings(name: &str) -> Vec<String> {
    let mut names = vec![name.to_owned()];
    if name.contains('\\') {
        names.push(name.replace('\\', "/"));
    }
    if let [drive, b':', b'/' | b'\\', ..] = name.as_bytes()
        && drive.is_ascii_alphabetic()
    {
        let parts: Vec<&str> =
            name[3..].split(['/', '\\']).filter(|part| !part.is_empty()).collect();
        names.extend((0..parts.len()).map(|k| parts[k..].join("/")));
    }
    names
}

/// The mask of a picture in a folder of masks: a file with the name of the picture, with or without its parent folders, and any picture
/// extension; or in the convention of COLMAP, the whole name and `.png`. The first that exists.
pub fn find_mask(folder: &Path, picture: &str) -> Option<PathBuf> {
    let picture = picture.replace('\\', "/");
    let parts: Vec<&str> = picture.split('/').filter(|part| !part.is_empty()).collect();
    let names = (0..parts.len()).map(|k| parts[k..].join("/"));
    let candidates = names.flat_map(|name| {
        let stem = stem(&name).to_owned();
        let endings = ENDINGS.iter().flat_map(|ending| [ending.to_string(), ending.to_uppercase()]);
        let with_ending = endings.map(move |ending| format!("{stem}.{ending}"));
        [name.clone()].into_iter().chain(with_ending).chain([format!("{name}.png")])
    });
    candidates.map(|name| folder.join(name)).find(|path| path.is_file())
}

/// Whether a name in a camera file may refer to this file: both have the same name except folders and picture extension.
pub(super) fn is_called(path: &Path, name: &str) -> bool {
    let of_path = path.file_name().unwrap_or_default().to_string_lossy();
    let of_name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    !of_name.is_empty() && stem(&of_path) == stem(of_name)
}

/// A name without its picture extension.
fn stem(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, ending)) if ENDINGS.contains(&&*ending.to_ascii_lowercase()) => stem,
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn pictures_are_found_by_the_names_that_tools_and_windows_write() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("set");
        fs::create_dir_all(inside.join("images")).unwrap();
        for name in [
            "set/images/00.png",
            "set/images/r_01.5.png",
            "set/images/b.JPG",
            "set/images/plain",
            "set/images/c.jpeg",
            "beside.png",
        ] {
            fs::write(folder.path().join(name), b"").unwrap();
        }
        for (name, expected) in [
            ("images/00.png", "images/00.png"),
            ("./images/00", "images/00.png"),
            ("images\\00.png", "images/00.png"),
            (".\\images\\00", "images/00.png"),
            ("./images/r_01.5", "images/r_01.5.png"),
            ("images\\r_01.5", "images/r_01.5.png"),
            ("images/b", "images/b.JPG"),
            ("images/c", "images/c.jpeg"),
            ("images/plain", "images/plain"),
            ("../beside", "../beside.png"),
            ("..\\beside.png", "../beside.png"),
            ("D:\\scans\\set\\images\\00.png", "images/00.png"),
            ("C:/scans/images/r_01.5", "images/r_01.5.png"),
        ] {
            let found = picture_path(&inside, name);
            let expected = inside.join(expected);
            assert_eq!(found.canonicalize().unwrap(), expected.canonicalize().unwrap(), "{name}");
        }
        // A missing file gets its most likely name.
        assert!(picture_path(&inside, "images/no").ends_with("images/no.png"));
        assert!(picture_path(&inside, "images/no.png").ends_with("images/no.png"));
        assert!(picture_path(&inside, "").ends_with(".png"));
    }

    #[test]
    fn masks_have_the_names_of_their_pictures() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("left")).unwrap();
        for name in ["left/00.png", "00.gif", "01.JPG.png", "r_0.5.PNG"] {
            fs::write(folder.path().join(name), b"").unwrap();
        }
        for (picture, mask) in [
            ("images/left/00.jpg", Some("left/00.png")),
            ("images\\left\\00.jpg", Some("left/00.png")),
            ("./images/right/00.jpg", Some("00.gif")),
            ("01.JPG", Some("01.JPG.png")),
            ("images/r_0.5", Some("r_0.5.PNG")),
            ("images/02.png", None),
            ("", None),
        ] {
            let found = find_mask(folder.path(), picture);
            assert_eq!(found, mask.map(|mask| folder.path().join(mask)), "{picture}");
        }
        assert!(is_called(Path::new("a/00.png"), "images\\00.JPG"));
        assert!(is_called(Path::new("00"), "./x/00.jpeg") && is_called(Path::new("r.5"), "r.5"));
        assert!(!is_called(Path::new("00.png"), "000.png") && !is_called(Path::new("a"), "a/"));
    }
}
