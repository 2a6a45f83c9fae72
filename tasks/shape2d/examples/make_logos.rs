//! Writes the pictures in `data/logos`: `cargo run --release -p shape2d --example make_logos`.

use std::path::Path;

use shape2d::Logo;
use softrast_cli::Variant;
use softrast_lab::rgb_from_gray;

const SIZE: usize = 256;

fn main() -> anyhow::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/logos");
    std::fs::create_dir_all(&folder)?;
    for (name, variant) in [("letters", Variant::Original), ("skyline", Variant::Transfer)] {
        let image = rgb_from_gray(&Logo::of(variant).image(SIZE), SIZE, SIZE);
        let gray = image::DynamicImage::from(image).into_luma8();
        gray.save(folder.join(name).with_extension("png"))?;
    }
    Ok(())
}
