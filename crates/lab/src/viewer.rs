//! A mesh on a page that can be rotated, zoomed, and viewed through its cameras.

use base64::{Engine, engine::general_purpose::STANDARD};
use serde::{Serialize, Serializer};
use serde_json::json;

use crate::report::{Report, escape, image};

/// A mesh and its cameras, to rotate and zoom on a page.
///
/// Vertices and faces take 16 characters of the page each: a closed mesh of 200 000 faces makes a
/// page of 5 MB, which opens in a second. From a million faces on only the picture is shown.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Viewer {
    /// Vertices in world units; the page stores them as f32.
    #[serde(serialize_with = "positions")]
    pub positions: Vec<[f64; 3]>,
    /// Triangles as indices of `positions`. Both sides are drawn, so their orientation does not matter.
    #[serde(serialize_with = "faces")]
    pub faces: Vec<[u32; 3]>,
    /// Red, green and blue of each vertex from 0 to 1, if the mesh has colours; the page stores them as bytes.
    #[serde(serialize_with = "colours", skip_serializing_if = "Option::is_none")]
    pub colours: Option<Vec<[f64; 3]>>,
    /// Views in the order of the page; may be empty.
    pub views: Vec<ViewerView>,
    /// The view that the page opens with, with the outline of its mask; `None` shows the mesh from beside the cameras.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opens: Option<usize>,
}

/// A pinhole camera with the mask that the mesh should fill in it.
///
/// A point `p` of the world is at `c = rotation · p + translation` in the camera, with x to the
/// right, y down and z ahead, and appears at `focal · c.xy / c.z + centre` in the image.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ViewerView {
    /// Name on the page.
    pub name: String,
    /// Rows of the rotation from world to camera.
    pub rotation: [[f64; 3]; 3],
    /// Translation in world units.
    pub translation: [f64; 3],
    /// Focal lengths along x and y, in pixels.
    pub focal: [f64; 2],
    /// Principal point in pixels; (0, 0) is the outer corner of the first pixel.
    pub centre: [f64; 2],
    /// Width of the image in pixels.
    pub width: usize,
    /// Height of the image in pixels.
    pub height: usize,
    /// The target mask as a gray PNG, inside from 128 on. It is stretched over the image, so it may be smaller; empty if there is none.
    #[serde(rename = "mask", serialize_with = "base64")]
    pub mask_png: Vec<u8>,
    /// A note on the view, such as "intersection over union 0.97, held out".
    pub note: String,
}

impl Report {
    /// A mesh to rotate and zoom, with the outlines of the target masks over it.
    ///
    /// The PNG `fallback_png` is shown without WebGL or scripts, and in any case if the mesh has no
    /// faces or at least a million, or if a number is not finite.
    ///
    /// # Panics
    ///
    /// If a face refers to a missing vertex, the number of colours differs from that of vertices, or a view has an image without pixels.
    pub fn viewer(&mut self, viewer: &Viewer, fallback_png: &[u8], caption: &str) {
        viewer.check();
        if !viewer.can_be_drawn() {
            return self.picture(fallback_png, caption);
        }
        let (image, data) = (image(fallback_png, caption), viewer.json());
        let script = format!("<script type=\"application/json\">{data}</script>");
        let content = format!("<div class=\"viewer\">\n{image}\n{script}\n</div>");
        self.figure(&content, &escape(caption));
        self.has_viewer = true;
    }
}

impl Viewer {
    fn check(&self) {
        let vertices = self.positions.len();
        for (k, face) in self.faces.iter().enumerate() {
            let inside = face.iter().all(|&vertex| (vertex as usize) < vertices);
            assert!(inside, "face {k} is {face:?}, but there are {vertices} vertices");
        }
        let colours = self.colours.as_ref().map_or(vertices, Vec::len);
        assert_eq!(colours, vertices, "colours and vertices");
        for ViewerView { name, width, height, .. } in &self.views {
            assert!(width * height > 0, "view {name:?} has {width} x {height} pixels");
        }
    }

    fn can_be_drawn(&self) -> bool {
        let finite = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
        let is_camera = |view: &ViewerView| {
            let ViewerView { rotation, translation, focal, centre, .. } = view;
            let numbers = [rotation.as_flattened(), translation, focal, centre];
            numbers.into_iter().all(finite) && focal.iter().all(|&f| f > 0.0)
        };
        let has_faces =
            (1..1_000_000).contains(&self.faces.len()) && finite(self.positions.as_flattened());
        has_faces && self.views.iter().all(is_camera)
    }

    /// JSON that is safe inside a script element.
    fn json(&self) -> String {
        // A name may contain `</script>`; outside strings, JSON has no `<`.
        json!(self).to_string().replace('<', "\\u003c")
    }
}

/// Coordinates as f32.
fn positions<S: Serializer>(positions: &[[f64; 3]], serializer: S) -> Result<S::Ok, S::Error> {
    let floats = positions.as_flattened().iter().map(|&x| x as f32);
    base64(&floats.flat_map(f32::to_le_bytes).collect::<Vec<_>>(), serializer)
}

fn faces<S: Serializer>(faces: &[[u32; 3]], serializer: S) -> Result<S::Ok, S::Error> {
    let indices = faces.as_flattened().iter();
    base64(&indices.flat_map(|index| index.to_le_bytes()).collect::<Vec<_>>(), serializer)
}

fn colours<S: Serializer>(
    colours: &Option<Vec<[f64; 3]>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let channels = colours.iter().flatten().flatten();
    base64(
        &channels.map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8).collect::<Vec<_>>(),
        serializer,
    )
}

fn base64<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&STANDARD.encode(bytes))
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::report::VIEWER;

    const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];

    fn triangle() -> Viewer {
        let view = ViewerView {
            name: "front </script><b> & \"x\"".into(),
            rotation: UPRIGHT,
            translation: [0.0, 0.25, 3.0],
            focal: [90.0, 80.0],
            centre: [32.5, 24.0],
            width: 64,
            height: 48,
            mask_png: vec![1, 2, 3],
            note: "IoU <0.97>".into(),
        };
        let positions = vec![[0.1, -2.0, 3e4], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let faces = vec![[0, 1, 2], [2, 1, 0]];
        Viewer { positions, faces, colours: None, views: vec![view], opens: Some(0) }
    }

    fn page(viewers: &[Viewer]) -> String {
        let mut report = Report::new("t", "a");
        for viewer in viewers {
            report.viewer(viewer, b"PNG", "A <mesh>");
        }
        report.finish("c", &[])
    }

    fn data(page: &str) -> Vec<Value> {
        let opening = "<script type=\"application/json\">";
        let texts = page.split(opening).skip(1).map(|rest| rest.split("</script>").next().unwrap());
        texts.map(|text| serde_json::from_str(text).unwrap()).collect()
    }

    /// Numbers of four bytes each.
    fn words(value: &Value) -> Vec<[u8; 4]> {
        let bytes = STANDARD.decode(value.as_str().unwrap()).unwrap();
        bytes.chunks_exact(4).map(|word| word.try_into().unwrap()).collect()
    }

    #[test]
    fn a_page_holds_all_of_the_mesh_and_its_views() {
        let data = &data(&page(&[triangle()]))[0];
        let positions: Vec<_> =
            words(&data["positions"]).into_iter().map(f32::from_le_bytes).collect();
        assert_eq!(positions, [0.1, -2.0, 3e4, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let faces: Vec<_> = words(&data["faces"]).into_iter().map(u32::from_le_bytes).collect();
        assert_eq!(faces, [0, 1, 2, 2, 1, 0]);
        let view = json!({
            "name": "front </script><b> & \"x\"", "note": "IoU <0.97>", "mask": "AQID",
            "rotation": UPRIGHT, "translation": [0.0, 0.25, 3.0], "focal": [90.0, 80.0],
            "centre": [32.5, 24.0], "width": 64, "height": 48,
        });
        assert_eq!(data["views"], json!([view]));
    }

    #[test]
    fn colours_are_bytes_and_left_out_where_there_are_none() {
        assert_eq!(data(&page(&[triangle()]))[0]["colours"], Value::Null);
        let colours = Some(vec![[0.0, 0.2, 1.0], [1.0, 0.0, 0.0], [f64::NAN, 2.0, -1.0]]);
        let found = &data(&page(&[Viewer { colours, ..triangle() }]))[0]["colours"];
        let bytes = STANDARD.decode(found.as_str().unwrap()).unwrap();
        assert_eq!(bytes, [0, 51, 255, 255, 0, 0, 0, 255, 0]);
    }

    #[test]
    #[should_panic(expected = "colours and vertices")]
    fn a_missing_colour_panics() {
        page(&[Viewer { colours: Some(vec![[0.0; 3]]), ..triangle() }]);
    }

    #[test]
    fn names_and_captions_cannot_end_what_they_are_in() {
        let page = page(&[triangle()]);
        assert_eq!(page.matches("</script>").count(), 2, "one of the data, one of the code");
        assert!(!page.contains("</script><b>") && !page.contains("<mesh>"));
        assert!(page.contains("<img alt=\"A &lt;mesh&gt;\" src=\"data:image/png;base64,UE5H\">"));
        assert!(page.contains("<figcaption>A &lt;mesh&gt;</figcaption>"));
        assert!(!VIEWER[1].contains("</script") && !VIEWER[0].contains("</style"));
    }

    #[test]
    fn several_on_a_page_share_the_script_and_have_no_ids() {
        let mut other = triangle();
        other.views.clear();
        let page = page(&[triangle(), other]);
        assert_eq!(page.matches("<div class=\"viewer\">").count(), 2);
        assert_eq!([page.matches(VIEWER[1]).count(), page.matches(VIEWER[0]).count()], [1, 1]);
        assert_eq!(data(&page)[1]["views"], json!([]));
        assert!(!page.contains(" id=") && !VIEWER[1].contains(".id ="));
    }

    #[test]
    fn a_page_without_viewer_has_no_script() {
        let page = page(&[]);
        assert!(!page.contains("<script") && !page.contains(".viewer"));
    }

    #[test]
    fn what_cannot_be_drawn_is_a_picture() {
        let mut cases = [(); 4].map(|()| triangle());
        cases[0].faces.clear();
        cases[1].positions[1][2] = f64::NAN;
        cases[2].views[0].translation[0] = f64::INFINITY;
        cases[3].views[0].focal[1] = 0.0;
        for case in cases {
            let page = page(&[case]);
            assert!(page.contains("<img alt=") && !page.contains("<script"), "{page}");
        }
    }

    #[test]
    #[should_panic(expected = "face 1 is [2, 1, 3], but there are 3 vertices")]
    fn a_face_of_a_missing_vertex_panics() {
        let mut viewer = triangle();
        viewer.faces[1][2] = 3;
        page(&[viewer]);
    }
}
