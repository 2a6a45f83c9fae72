use std::{fmt::Display, path::PathBuf};

use anyhow::Context;
use serde_json::{Value, json};
use softrast_mesh::Mesh;
use softrast_raster::Pinhole;

use crate::{
    Distortion, Picture,
    cameras::{SAID, rounded_note},
    colmap_pose, cut_sides, mask_parts,
};

/// A camera as JSON: R and t of OpenCV, the camera-to-world matrix of nerfstudio (`transform_matrix`), the pose of COLMAP (`colmap`: QW,
/// QX, QY, QZ, TX, TY, TZ), K, width and height, and the equivalent orbit if there is one.
///
/// ```
/// use softrast_raster::Pinhole;
/// use softrast_views::{PoseFile, camera_json};
///
/// let camera = Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 64);
/// let json = camera_json(&camera);
/// assert_eq!(json["width"], 64);
/// let pose = PoseFile::parse(json.to_string().as_bytes(), "camera.json")?;
/// assert_eq!(pose.translation, camera.translation);
/// # anyhow::Ok(())
/// ```
pub fn camera_json(camera: &Pinhole) -> Value {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    let mut found = json!({
        "R": camera.rotation,
        "t": camera.translation,
        "transform_matrix": camera.to_opengl(),
        "colmap": colmap_pose(camera),
        "K": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        "width": camera.size.width,
        "height": camera.size.height,
    });
    if let Some(orbit) = camera.orbit() {
        found["orbit"] = json!({
            "distance": orbit.distance,
            "elevation_deg": orbit.elevation_deg,
            "azimuth_deg": orbit.azimuth_deg,
            "fov_deg": orbit.fov_deg,
        });
    }
    found
}

/// Intersection over union of a silhouette and a mask, thresholded at one half. 1 if both are empty.
///
/// # Panics
///
/// If their numbers of pixels differ.
pub fn mask_iou(silhouette: &[f64], mask: &Picture) -> f64 {
    assert_eq!(silhouette.len(), mask.pixels().len(), "pixels of the silhouette and the mask");
    let pairs = || silhouette.iter().zip(mask.pixels()).map(|(&a, &b)| (a >= 0.5, b >= 0.5));
    let both = pairs().filter(|&(a, b)| a && b).count();
    let either = pairs().filter(|&(a, b)| a || b).count();
    if either == 0 { 1.0 } else { both as f64 / either as f64 }
}

/// A picture and the camera that took it.
#[derive(Clone, Debug)]
pub struct View {
    /// The name in the file.
    pub name: String,
    /// The file of the picture.
    pub picture: PathBuf,
    /// The mask, undistorted.
    pub mask: Picture,
    /// The camera of the picture, for the pixels of the mask.
    pub camera: Pinhole,
    /// Lens distortion of the picture in its file, if there is one.
    pub distortion: Option<Distortion>,
    /// Deviation of R Rᵀ from the identity in the file, before R was replaced by the nearest rotation.
    pub off: f64,
}

impl View {
    /// Removes lens distortion from a picture of this camera, of the size of the mask.
    #[must_use]
    pub fn undistorted(&self, picture: Picture) -> Picture {
        match &self.distortion {
            Some(distortion) => picture.undistorted(&self.camera, distortion),
            None => picture,
        }
    }

    /// The view square of the mask: left, top and extent in pixels. See [`Picture::view_square`].
    ///
    /// # Errors
    ///
    /// If no pixel or every pixel of the mask is white, with the name of the view.
    pub fn square(&self) -> anyhow::Result<[f64; 3]> {
        self.mask.view_square().with_context(|| self.name.clone())
    }
}

/// Notes for the user on views that were read, one line per kind: undistorted pictures, masks whose only level became white, masks that may
/// be inverted or show several objects, and rounded rotations.
pub fn reading_notes(views: &[View]) -> Vec<String> {
    let masks = views.iter().filter_map(|view| Some((view.mask.only_level()?, &view.name)));
    let masks: Vec<(f64, &String)> = masks.collect();
    let mut notes = Vec::new();
    let bent = views.iter().filter(|view| view.distortion.is_some()).count();
    if bent > 0 {
        notes.push(format!(
            "the lens distorts {}: pictures and masks were undistorted, and the camera keeps its fx, fy, cx, cy, R and t",
            if bent == views.len() { "the pictures".to_owned() } else { format!("{bent} of {} pictures", views.len()) }
        ));
    }
    if let Some(&(level, _)) = masks.first() {
        let of = first_and_more(masks.iter().map(|(_, name)| *name));
        notes.push(format!(
            "{of}: one level is above black and nothing else, {level:.4} where white is 1: it is taken for the mask"
        ));
    }
    let named = |which: &dyn Fn(&Picture) -> bool| {
        let named: Vec<&String> =
            views.iter().filter(|view| which(&view.mask)).map(|view| &view.name).collect();
        (!named.is_empty()).then(|| first_and_more(named.into_iter()))
    };
    notes.extend(named(&|mask| cut_sides(mask).len() == 4).map(|of| {
        format!("{of}: the mask reaches all four sides of the picture: is it inverted (--invert)?")
    }));
    notes.extend(named(&|mask| mask_parts(mask) > 1).map(|of| {
        format!(
            "{of}: the mask has several large parts: if they are several objects, keep one of them (--label N, if each has a class)"
        )
    }));
    let rounded = || views.iter().filter(|view| view.off >= SAID);
    let worst = rounded().max_by(|a, b| a.off.total_cmp(&b.off));
    notes.extend(worst.map(|view| rounded_note(&view.name, view.off, rounded().count())));
    notes
}

/// The first of some names, and the number of others.
fn first_and_more<'a>(mut names: impl ExactSizeIterator<Item = &'a String>) -> String {
    let more = names.len().saturating_sub(1);
    let first = names.next().map_or("", String::as_str);
    if more == 0 { first.to_owned() } else { format!("{first} and {more} more") }
}

/// Number of faces of a mesh that cross the plane at a depth in front of a camera, in world units: they have corners on both sides. Those
/// across [`NEAR`](softrast_raster::NEAR) are not drawn.
///
/// ```
/// use softrast_mesh::icosphere;
/// use softrast_raster::{NEAR, Pinhole};
/// use softrast_views::faces_across;
///
/// let [outside, inside] = [4.0, 0.5].map(|z| {
///     let camera = Pinhole::look_at([0.0, 0.0, z], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 64);
///     faces_across(&icosphere(2), &camera, NEAR)
/// });
/// assert!(outside == 0 && inside > 0);
/// ```
pub fn faces_across(mesh: &Mesh, camera: &Pinhole, depth: f64) -> usize {
    let ahead: Vec<bool> =
        mesh.positions().iter().map(|&p| camera.transform(p)[2] >= depth).collect();
    let crosses = |face: &&[u32; 3]| {
        let before = face.iter().filter(|&&v| ahead[v as usize]).count();
        before > 0 && before < face.len()
    };
    mesh.faces().iter().filter(crosses).count()
}

/// A note for the user if [`faces_across`] is above 0 for some cameras, each with its name.
pub fn faces_across_note<N: Display>(
    mesh: &Mesh,
    cameras: impl IntoIterator<Item = (N, Pinhole)>,
    depth: f64,
) -> Option<String> {
    let cameras = cameras.into_iter();
    let counts = cameras.map(|(name, camera)| (faces_across(mesh, &camera, depth), name));
    let crossed: Vec<(usize, N)> = counts.filter(|(count, _)| *count > 0).collect();
    let (most, name) = crossed.iter().max_by_key(|(count, _)| *count)?;
    let more = match crossed.len() {
        1 => String::new(),
        all => format!(", and some in {} more", all - 1),
    };
    Some(format!(
        "{most} of {} faces reach behind the camera of {name}{more}: they are not drawn, so what they cover is missing; cut the mesh, or move \
         the camera away from it",
        mesh.faces().len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Pinhole {
        Pinhole::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, [3, 4])
    }

    fn view(name: &str, mask: Picture, off: f64) -> View {
        View {
            name: name.to_owned(),
            picture: name.into(),
            mask,
            camera: camera(),
            distortion: None,
            off,
        }
    }

    #[test]
    fn rounded_rotations_are_one_line_that_names_the_worst() {
        let mask = || Picture::new([vec![0.0; 5], vec![1.0], vec![0.0; 6]].concat(), 4);
        let views = [view("a", mask(), 1e-9), view("b", mask(), 1e-3), view("c", mask(), 2e-3)];
        let notes = reading_notes(&views);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(
            notes[0].starts_with("c: its rotation, as those of 1 more, is rounded"),
            "{notes:?}"
        );
        assert!(reading_notes(&views[..1]).is_empty());
    }

    #[test]
    fn a_pixel_of_one_half_is_in() {
        let mask = Picture::new(vec![1.0, 0.5, 0.49, 0.0], 2);
        assert_eq!(mask_iou(&[0.5, 0.5, 0.49, 0.0], &mask), 1.0);
        assert_eq!(mask_iou(&[0.5, 0.49, 0.5, 0.0], &mask), 1.0 / 3.0);
        assert_eq!(mask_iou(&[0.0; 4], &Picture::new(vec![0.0; 4], 2)), 1.0);
    }

    #[test]
    fn white_at_all_four_sides_is_told() {
        let full = |name| view(name, Picture::new(vec![1.0; 12], 4), 0.0);
        let notes = reading_notes(&[full("a"), full("b")]);
        assert!(notes.len() == 1 && notes[0].starts_with("a and 1 more: "), "{notes:?}");
        assert!(notes[0].contains("--invert"), "{notes:?}");
    }

    #[test]
    fn faces_on_both_sides_of_a_camera_are_counted() {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 9.0], [1.0, 1.0, 9.0]];
        let all = vec![[0, 1, 2], [1, 3, 2], [0, 1, 0], [2, 3, 2]];
        let mesh = Mesh::new(positions, all).unwrap();
        assert_eq!(faces_across(&mesh, &camera(), 0.0), 2);
        let note = faces_across_note(&mesh, [("a.png", camera())], 0.0).unwrap();
        assert!(note.starts_with("2 of 4 faces reach behind the camera of a.png: "), "{note}");
        let two = faces_across_note(&mesh, [("a", camera()), ("b", camera())], 0.0).unwrap();
        assert!(two.contains("some in 1 more"), "{two}");
        let before = Mesh::new(mesh.positions()[..2].to_vec(), vec![[0, 1, 0]]).unwrap();
        assert_eq!(faces_across_note(&before, [("a", camera())], 0.0), None);
    }
}
