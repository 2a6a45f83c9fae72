//! Writes the meshes in `data/meshes`: `cargo run --release -p softrast-mesh --example make_data`.

use std::{error::Error, io::Cursor, path::Path};

use image::{ImageFormat, Rgb, RgbImage};
use softrast_mesh::{Mesh, Texture, airplane, chair, fox};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/meshes");
    for (name, mesh) in [("fox", fox()), ("airplane", airplane()), ("chair", chair())] {
        mesh.save(folder.join(name).with_extension("obj"))?;
    }
    Ok(painted(fox())?.save(folder.join("fox.glb"))?)
}

/// Side length of the fox's picture, in texels.
const SIDE: u32 = 256;

/// The fox with a picture projected from the side: u goes from its nose to its tail, v from its paws to its ears.
fn painted(fox: Mesh) -> Result<Mesh, Box<dyn Error>> {
    let [low, high] = fox.bounds();
    let share = |p: &[f64; 3], k: usize| (p[k] - low[k]) / (high[k] - low[k]);
    let coordinates = fox.positions().iter().map(|p| [share(p, 2), share(p, 1)]).collect();
    let picture = RgbImage::from_fn(SIDE, SIDE, |x, y| {
        let [u, v] = [x, SIDE - 1 - y].map(|at| (f64::from(at) + 0.5) / f64::from(SIDE));
        fur(low[2] + u * (high[2] - low[2]), low[1] + v * (high[1] - low[1]))
    });
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png)?;
    let texture =
        Texture::new(coordinates, fox.faces().to_vec())?.with_picture(png.into_inner())?;
    Ok(fox.with_texture(texture)?)
}

/// The colour of the fox by z, which is lowest at the front, and height.
fn fur(z: f64, y: f64) -> Rgb<u8> {
    const RED: Rgb<u8> = Rgb([214, 106, 38]);
    const WHITE: Rgb<u8> = Rgb([245, 238, 228]);
    const DARK: Rgb<u8> = Rgb([58, 40, 36]);
    let within = |[z0, y0]: [f64; 2], radius: f64| (z - z0).hypot(y - y0) < radius;
    let (legs, ears, nose, eyes) = (y < -0.36, y > 0.8 && z < 0.0, z < -0.9, [-0.71, 0.59]);
    let tip = z > 0.5 && y > 0.62;
    let jaw = z < -0.5 && y < 0.44 - 0.3 * (z + 0.6) && y > 0.3;
    let chest = within([-0.62, 0.12], 0.24);
    match () {
        () if legs || ears || nose || within(eyes, 0.035) => DARK,
        () if tip || jaw || chest => WHITE,
        () => RED,
    }
}
