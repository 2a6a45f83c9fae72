//! A camera in a table, and as other programs have it.

use serde_json::{Value, json};
use softrast_inverse::pose::FoundPose;
use softrast_lab::{format::short, report::Table};
use softrast_mesh::vectors::norm;
use softrast_raster::Pinhole;
use softrast_views::{Frame, camera_json};

/// A camera in the formats of other programs, each with a label.
pub(super) fn in_other_forms(camera: &Pinhole, name: &str) -> [(&'static str, String); 3] {
    let json = camera_json(camera);
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    let (w, h) = (camera.size.width, camera.size.height);
    // OpenCV has (0, 0) at the centre of the first pixel.
    let k = [[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]];
    let opencv = json!({ "R": json["R"], "t": json["t"], "K": k });
    let frame = json!({
        "file_path": name, "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": w, "h": h,
        "transform_matrix": json["transform_matrix"],
    });
    let numbers = json["colmap"].as_array().into_iter().flatten().map(Value::to_string);
    let numbers = numbers.collect::<Vec<_>>().join(" ");
    let colmap = format!("1 PINHOLE {w} {h} {fx} {fy} {cx} {cy}\n\n1 {numbers} 1 {name}\n");
    [
        ("OpenCV: R, t and K (the middle of the first pixel is (0, 0))", opencv.to_string()),
        ("nerfstudio: a frame of transforms.json", frame.to_string()),
        ("COLMAP: a line of cameras.txt and one of images.txt, with 1 for both numbers", colmap),
    ]
}

/// The camera of a pose in numbers.
pub(super) fn of_camera(pose: &FoundPose, frame: &Frame) -> Table {
    let camera = &pose.camera;
    let row =
        |values: &[f64]| values.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(", ");
    let mut pairs = Vec::new();
    pairs.extend(pose.psnr.map(|psnr| ["Colours, PSNR".to_owned(), format!("{psnr:.1} dB")]));
    for (k, values) in camera.rotation.iter().enumerate() {
        pairs.push([format!("R, row {}", k + 1), row(values)]);
    }
    pairs.push(["t".to_owned(), row(&camera.translation)]);
    pairs.push(["Camera stands at".to_owned(), row(&camera.eye())]);
    let distance = norm(camera.transform(frame.middle));
    pairs.push(["Distance to the middle of the mesh".to_owned(), short(distance)]);
    pairs.push([
        "fx, fy, cx, cy in pixels".to_owned(),
        row(&[camera.focal, camera.centre].concat()),
    ]);
    Table::pairs(pairs)
}
