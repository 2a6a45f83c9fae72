//! One picture for all faces of a mesh.

mod layout;
mod pictures;
mod texels;

use anyhow::{Error, anyhow};
use image::RgbImage;
use softrast_mesh::Mesh;

use self::{
    layout::{Layout, WHITE},
    pictures::Pictures,
    texels::{between, texels},
};

/// Most reductions of pictures until everything fits.
const MOST_ROUNDS: usize = 8;

/// A single picture for all faces of a mesh, for any materials: pictures, factors and vertex colours are multiplied as in glTF.
///
/// A single picture without a factor is used unchanged. Otherwise the visible parts of the pictures are packed. Colours interpolated
/// between texels equal those of the original pictures, also across seams and repeats.
///
/// ```
/// use softrast_mesh::{Material, Mesh, Texture};
/// use softrast_views::Atlas;
///
/// let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
/// let mesh = Mesh::new(corners, vec![[0, 1, 2], [2, 1, 3]])?;
/// let [red, blue] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]].map(|of| Material::default().with_factor(of));
/// let texture = Texture::new(vec![[0.0; 2]], vec![[0; 3]; 2])?.with_materials(vec![red?, blue?], vec![0, 1])?;
/// let (atlas, errors) = Atlas::of(&mesh.with_texture(texture)?, 1 << 10);
/// let atlas = atlas.unwrap();
/// let blue = atlas.colour_at(atlas.coordinates()[atlas.corners()[1][0] as usize]);
/// assert!(errors.is_empty() && blue[0] == 0.0 && blue[2] > 0.5);
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Atlas {
    coordinates: Vec<[f64; 2]>,
    corners: Vec<[u32; 3]>,
    picture: RgbImage,
}

impl Atlas {
    /// The atlas of the texture of a mesh, of at most `most` texels, and the errors of omitted pictures. Pictures that are too large are
    /// reduced. `None` if the mesh has no texture, or one whose materials have neither readable pictures nor factors: vertex colours
    /// suffice then.
    pub fn of(mesh: &Mesh, most: usize) -> (Option<Self>, Vec<Error>) {
        let Some(texture) = mesh.texture() else { return (None, vec![]) };
        let mut pictures = Pictures::of(texture);
        let mut errors = pictures.reduce(texture, most, |_| 1.0);
        let is_plain = |number: usize| {
            pictures.of_material(number).is_none() && texture.materials()[number].factor() == WHITE
        };
        if (0..texture.materials().len()).all(is_plain) {
            return (None, errors);
        }
        let multiplies = texture.multiplies_colours() && mesh.colours().is_some();
        if let ([material], Some(picture), false) =
            (texture.materials(), pictures.of_material(0), multiplies)
            && material.factor() == WHITE
        {
            let (coordinates, corners) =
                (texture.coordinates().to_vec(), texture.corners().to_vec());
            return (Some(Self { coordinates, corners, picture: picture.clone() }), errors);
        }
        for _ in 0..MOST_ROUNDS {
            let layout = Layout::of(mesh, texture, &pictures);
            let packed = layout.packed();
            let texels = packed.width as f64 * packed.height as f64;
            if texels <= most as f64 {
                let (coordinates, corners) = layout.coordinates(&packed);
                let picture = layout.drawn(&packed, texture, &pictures);
                return (Some(Self { coordinates, corners, picture }), errors);
            }
            // Margins do not shrink with the pictures.
            let share = 0.8 * most as f64 / texels;
            errors.extend(pictures.reduce(texture, most, |pixels| share * pixels));
        }
        let faces = mesh.faces().len();
        errors.push(anyhow!("{faces} faces with several materials have no room in one picture"));
        (None, errors)
    }

    /// (u, v) from 0 to 1, v up; beyond that range the picture repeats.
    pub fn coordinates(&self) -> &[[f64; 2]] {
        &self.coordinates
    }

    /// For each face of the mesh, three indices into [`Atlas::coordinates`].
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// The picture.
    pub fn picture(&self) -> &RgbImage {
        &self.picture
    }

    /// The colour interpolated between texels at a coordinate, from 0 to 1 in sRGB.
    pub fn colour_at(&self, coordinate: [f64; 2]) -> [f64; 3] {
        between(texels(coordinate, &self.picture), &self.picture)
    }
}

/// A mesh with the colours of its texture at its vertices, as means over their neighbourhoods; `None` if the texture has none; and the
/// errors of omitted pictures.
///
/// A mesh of few faces is first subdivided as by [`Mesh::subdivided`], as long as it then has at most `most_faces`.
pub fn painted_by_texture(mesh: &Mesh, most_faces: usize) -> (Option<Mesh>, Vec<Error>) {
    let mut mesh = mesh.clone();
    let (atlas, errors) = Atlas::of(&mesh, MOST_TEXELS);
    if atlas.is_none() {
        return (None, errors);
    }
    while 4 * mesh.faces().len() <= most_faces {
        mesh = mesh.subdivided();
    }
    let Some(atlas) = Atlas::of(&mesh, MOST_TEXELS).0 else { return (None, errors) };
    let mut sums = vec![([0.0; 3], 0.0); mesh.positions().len()];
    for (face, corners) in mesh.faces().iter().zip(atlas.corners()) {
        let uv = corners.map(|k| atlas.coordinates()[k as usize]);
        for (k, &vertex) in face.iter().enumerate() {
            let (sum, count) = &mut sums[vertex as usize];
            for [own, next, last] in AROUND {
                let (a, b, c) = (uv[k], uv[(k + 1) % 3], uv[(k + 2) % 3]);
                let place = [0, 1].map(|axis| own * a[axis] + next * b[axis] + last * c[axis]);
                let colour = atlas.colour_at(place);
                (0..3).for_each(|c| sum[c] += colour[c]);
                *count += 1.0;
            }
        }
    }
    // A vertex that no face uses is not visible.
    let mean = |(sum, count): ([f64; 3], f64)| sum.map(|x| (x / count.max(1.0)).clamp(0.0, 1.0));
    let colours = sums.into_iter().map(mean).collect();
    (mesh.with_colours(colours).ok(), errors)
}

/// Texels of the atlas of a mesh whose vertices are coloured.
const MOST_TEXELS: usize = 1 << 22;
/// Barycentric weights of the sample points of a vertex: the corner itself, and three points around it.
const AROUND: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.7, 0.3, 0.0], [0.7, 0.0, 0.3], [0.6, 0.2, 0.2]];

#[cfg(test)]
mod tests {
    use super::{
        layout::{GREY, byte},
        *,
    };
    use crate::PictureFile;
    use image::Rgb;
    use softrast_mesh::{Material, Texture, from_linear, icosphere, to_linear};

    /// A picture with different colours in adjacent texels, as a PNG file.
    fn png(width: u32, height: u32, seed: u32) -> Vec<u8> {
        let level = |x: u32, y: u32, k: u32| (37 * x + 91 * y + 53 * k + 17 * seed) % 256;
        let picture =
            RgbImage::from_fn(width, height, |x, y| Rgb([0, 1, 2].map(|k| level(x, y, k) as u8)));
        let mut file = std::io::Cursor::new(vec![]);
        picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
        file.into_inner()
    }

    /// A ball textured by its positions, with `repeats` repeats; the faces alternate between three materials: a picture with a factor, only
    /// a factor, another picture.
    fn ball(repeats: f64) -> (Mesh, Vec<Material>) {
        let ball = icosphere(1);
        let places = ball.positions().iter().map(|p| [p[0] * repeats, p[1] * repeats - 3.0]);
        let texture = Texture::new(places.collect(), ball.faces().to_vec()).unwrap();
        let materials = vec![
            Material::default()
                .with_picture(png(7, 4, 1))
                .unwrap()
                .with_factor([0.5, 1.0, 0.2])
                .unwrap(),
            Material::default().with_factor([0.1, 0.0, 1.0]).unwrap(),
            Material::default().with_picture(png(5, 9, 2)).unwrap(),
        ];
        let of_faces = (0..80).map(|face| face % 3).collect();
        let texture = texture.with_materials(materials.clone(), of_faces).unwrap();
        (ball.with_texture(texture).unwrap(), materials)
    }

    const WITHIN: [[f64; 3]; 4] =
        [[1.0, 0.0, 0.0], [0.2, 0.5, 0.3], [0.0, 0.5, 0.5], [0.6, 0.3, 0.1]];

    fn at(corners: [[f64; 2]; 3], weights: [f64; 3]) -> [f64; 2] {
        [0, 1].map(|k| (0..3).map(|corner| weights[corner] * corners[corner][k]).sum())
    }

    /// The largest difference of an atlas from `expected`, a function of a face and barycentric weights.
    fn error(mesh: &Mesh, atlas: &Atlas, expected: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> f64 {
        let mut worst = 0.0f64;
        for face in 0..mesh.faces().len() {
            let corners = atlas.corners()[face].map(|k| atlas.coordinates()[k as usize]);
            for weights in WITHIN {
                let (found, right) =
                    (atlas.colour_at(at(corners, weights)), expected(face, weights));
                worst = (0..3).map(|k| (found[k] - right[k]).abs()).fold(worst, f64::max);
            }
        }
        worst
    }

    #[test]
    fn a_single_picture_stays_as_it_is() {
        let (ball, _) = ball(1.0);
        let texture = ball.texture().unwrap().clone().with_picture(png(7, 4, 1)).unwrap();
        let ball = ball.with_texture(texture.clone()).unwrap();
        let (atlas, errors) = Atlas::of(&ball, 100);
        let atlas = atlas.unwrap();
        assert!(errors.is_empty());
        assert_eq!(
            (atlas.coordinates(), atlas.corners()),
            (texture.coordinates(), texture.corners())
        );
        assert_eq!(atlas.picture().dimensions(), (7, 4));
        let (smaller, _) = Atlas::of(&ball, 10);
        assert!(smaller.unwrap().picture().len() <= 3 * 10);
    }

    #[test]
    fn colours_are_those_of_the_pictures_times_their_factors() {
        for repeats in [0.3, 1.0, 2.5] {
            let (ball, materials) = ball(repeats);
            let (atlas, errors) = Atlas::of(&ball, 1 << 20);
            let atlas = atlas.unwrap();
            assert!(errors.is_empty(), "{errors:?}");
            let texture = ball.texture().unwrap();
            let pictures = [png(7, 4, 1), png(5, 9, 2)]
                .map(|file| PictureFile::decode(&file).unwrap().texels(100));
            let expected = |face: usize, weights: [f64; 3]| {
                let material = &materials[face % 3];
                let picture = match face % 3 {
                    0 => &pictures[0],
                    1 => return material.factor().map(from_linear),
                    _ => &pictures[1],
                };
                let uv = texture.corners()[face].map(|k| texture.coordinates()[k as usize]);
                // Factors apply to linear light, interpolation to levels: so texels are multiplied first.
                let mut multiplied = picture.clone();
                for pixel in multiplied.pixels_mut() {
                    let light = pixel.0.map(|level| to_linear(f64::from(level) / 255.0));
                    pixel.0 = [0, 1, 2].map(|k| byte(from_linear(light[k] * material.factor()[k])));
                }
                between(texels(at(uv, weights), picture), &multiplied)
            };
            // Half a level.
            assert!(error(&ball, &atlas, expected) < 0.51 / 255.0, "{repeats}");
        }
    }

    #[test]
    fn colours_of_vertices_multiply_pictures_that_say_so() {
        let (ball, _) = ball(0.7);
        let white = RgbImage::from_pixel(3, 3, Rgb([255; 3]));
        let mut file = std::io::Cursor::new(vec![]);
        white.write_to(&mut file, image::ImageFormat::Png).unwrap();
        let texture = ball.texture().unwrap().clone().with_picture(file.into_inner()).unwrap();
        let colours: Vec<[f64; 3]> =
            ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * x)).collect();
        let ball = ball.with_colours(colours.clone()).unwrap();
        let plain = ball.clone().with_texture(texture.clone()).unwrap();
        let atlas = Atlas::of(&plain, 1 << 20).0.unwrap();
        assert_eq!(error(&plain, &atlas, |_, _| [1.0; 3]), 0.0, "without them");
        let lit = ball.with_texture(texture.multiplying_colours()).unwrap();
        let atlas = Atlas::of(&lit, 1 << 20).0.unwrap();
        let corner = |face: usize, weights: [f64; 3]| {
            let light = lit.faces()[face].map(|v| colours[v as usize].map(to_linear));
            let sum = |c: usize| (0..3).map(|k| weights[k] * light[k][c]).sum::<f64>();
            [0, 1, 2].map(|c| from_linear(sum(c)))
        };
        // Four texels along an edge are few: levels are interpolated between them, linear light is not.
        let worst = error(&lit, &atlas, corner);
        assert!(worst < 0.06, "{worst}");
    }

    #[test]
    fn faces_without_pictures_have_the_colours_of_their_vertices() {
        let (ball, materials) = ball(1.0);
        let colours: Vec<[f64; 3]> =
            ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * x)).collect();
        let ball = ball.with_colours(colours.clone()).unwrap();
        let atlas = Atlas::of(&ball, 1 << 20).0.unwrap();
        for face in (1..80).step_by(3) {
            let corners = atlas.corners()[face].map(|k| atlas.coordinates()[k as usize]);
            for k in 0..3 {
                let own = colours[ball.faces()[face][k] as usize];
                let factor = materials[1].factor();
                let right = [0, 1, 2].map(|c| from_linear(to_linear(own[c]) * factor[c]));
                let found = atlas.colour_at(corners[k]);
                assert!((0..3).all(|c| (found[c] - right[c]).abs() < 0.51 / 255.0));
            }
        }
    }

    #[test]
    fn a_texture_gives_colours_to_vertices() {
        let ball = icosphere(2);
        // From black at the left to white at the right.
        let slope = RgbImage::from_fn(64, 2, |x, _| Rgb([(4 * x) as u8; 3]));
        let mut file = std::io::Cursor::new(vec![]);
        slope.write_to(&mut file, image::ImageFormat::Png).unwrap();
        let places = ball.positions().iter().map(|p| [0.5 + 0.4 * p[0], 0.5]).collect();
        let texture = Texture::new(places, ball.faces().to_vec()).unwrap();
        let bare = ball.clone().with_texture(texture.clone()).unwrap();
        assert!(painted_by_texture(&bare, 5000).0.is_none(), "there is no picture");
        let ball = ball.with_texture(texture.with_picture(file.into_inner()).unwrap()).unwrap();
        for (most, faces) in [(100, 320), (5000, 1280)] {
            let (painted, errors) = painted_by_texture(&ball, most);
            let painted = painted.unwrap();
            assert_eq!((painted.faces().len(), errors.len()), (faces, 0));
            for (p, colour) in painted.positions().iter().zip(painted.colours().unwrap()) {
                let right = 4.0 * (64.0 * (0.5 + 0.4 * p[0]) - 0.5) / 255.0;
                assert!((colour[1] - right).abs() < 0.02, "{colour:?} and {right}");
            }
        }
    }

    #[test]
    fn atlases_keep_their_bound_and_broken_pictures_are_told() {
        let (ball, mut materials) = ball(3.0);
        let texture = ball.texture().unwrap().clone();
        for most in [5000, 20_000] {
            let (atlas, errors) = Atlas::of(&ball, most);
            assert!(errors.is_empty());
            let (width, height) = atlas.unwrap().picture().dimensions();
            assert!(width * height <= most as u32, "{width} x {height}");
        }
        // Eighty faces in ten texels.
        let (atlas, errors) = Atlas::of(&ball, 10);
        assert!(atlas.is_none() && errors[0].to_string().starts_with("80 faces with several"));
        let broken = b"\x89PNG\r\n\x1a\n and so on".to_vec();
        materials[2] = Material::default().with_picture(broken).unwrap();
        let of_faces = texture.of_faces().to_vec();
        let ball = ball.with_texture(texture.with_materials(materials, of_faces).unwrap()).unwrap();
        let (atlas, errors) = Atlas::of(&ball, 1 << 20);
        assert_eq!(errors.len(), 1);
        let atlas = atlas.unwrap();
        let corners = atlas.corners()[2].map(|k| atlas.coordinates()[k as usize]);
        let [grey, ..] = atlas.colour_at(at(corners, [0.3, 0.3, 0.4]));
        assert!((grey - GREY[0]).abs() < 0.003, "{grey}");
    }
}
