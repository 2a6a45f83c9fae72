type Colour = [f64; 3];

/// Height of the shore, and position of the sun, in NDC with y up.
const SHORE: f64 = -0.12;
const SUN: [f64; 2] = [0.38, 0.3];

/// A lake between hills in the evening, seen over grass: red, green and blue at each pixel, row by row from the top.
///
/// Drawn for this project, with the gradients, edges and texture of a photograph, at any size.
pub fn landscape(size: usize) -> Vec<[f64; 3]> {
    /// Samples along either side of a pixel.
    const SAMPLES: usize = 3;
    let at = |sample: usize| (2 * sample + 1) as f64 / (size * SAMPLES) as f64 - 1.0;
    let pixel = |pixel: usize| {
        let [column, row] = [pixel % size, pixel / size].map(|k| k * SAMPLES);
        let samples = (0..SAMPLES * SAMPLES).map(|k| [column + k % SAMPLES, row + k / SAMPLES]);
        let sum = samples.fold([0.0; 3], |sum, [x, y]| add(sum, colour_at(at(x), -at(y)), 1.0));
        sum.map(|sum| (sum / (SAMPLES * SAMPLES) as f64).clamp(0.0, 1.0))
    };
    (0..size * size).map(pixel).collect()
}

fn colour_at(x: f64, y: f64) -> Colour {
    if y < grass(x) {
        return meadow(x, y);
    }
    if let Some(colour) = tree(x, y) {
        return colour;
    }
    if y > SHORE {
        return beyond(x, y);
    }
    // Water: the reflected view, displaced by waves that are longer at the near end.
    let near = (SHORE - y).max(1e-3);
    let wave = noise(7.0 * x, 30.0 * (y + 1.0).ln_1p() * (1.0 + near), 3) - 0.5;
    let seen = beyond(x + 0.05 * near * wave, 2.0 * SHORE - y + 0.25 * near.sqrt() * wave);
    let glitter =
        (noise(9.0 * x, 60.0 * y, 2) - 0.62).max(0.0) * (-((x - SUN[0]) / 0.2).powi(2)).exp();
    let water = mix(seen, [0.10, 0.22, 0.34], 0.35 + 0.3 * near);
    add(water, [1.9, 1.5, 0.9], glitter)
}

/// Sky, sun, clouds and hills.
fn beyond(x: f64, y: f64) -> Colour {
    let hills = [
        (0.22, 0.26, 1.3, 11.0, [0.50, 0.46, 0.60]),
        (0.06, 0.24, 2.1, 37.0, [0.30, 0.34, 0.46]),
        (-0.04, 0.16, 3.4, 71.0, [0.13, 0.22, 0.23]),
    ];
    for (height, rise, pitch, at, colour) in hills.into_iter().rev() {
        let ridge = height + rise * (noise(pitch * x + at, at, 5) - 0.5);
        if y < ridge {
            let rock = noise(14.0 * x + at, 22.0 * y, 4) - 0.5;
            let haze = ((ridge - y) / 0.4).clamp(0.0, 0.7);
            let stone = add(colour, [0.5, 0.45, 0.4], 0.5 * rock);
            return mix(stone, [0.62, 0.56, 0.62], 0.8 * haze);
        }
    }
    let [sun_x, sun_y] = SUN;
    let far = ((x - sun_x).powi(2) + (y - sun_y).powi(2)).sqrt();
    let height = ((y + 0.1) / 1.1).clamp(0.0, 1.0);
    let sky = mix([0.98, 0.72, 0.48], [0.20, 0.38, 0.68], height.powf(0.7));
    let sky = add(sky, [0.9, 0.55, 0.2], 0.7 * (-far / 0.25).exp());
    let cloud = ((noise(1.8 * x + 5.0, 4.5 * y, 6) - 0.5) / 0.2).clamp(0.0, 1.0);
    let lit = mix([0.55, 0.45, 0.55], [1.0, 0.86, 0.72], noise(4.0 * x, 9.0 * y + 0.4, 4));
    let sky = mix(sky, lit, 0.85 * cloud);
    if far < 0.09 { mix([1.0, 0.95, 0.75], sky, 0.35 * cloud) } else { sky }
}

fn grass(x: f64) -> f64 {
    -0.66 + 0.12 * (noise(1.5 * x, 3.0, 2) - 0.5) + 0.07 * noise(40.0 * x, 9.0, 2)
}

fn meadow(x: f64, y: f64) -> Colour {
    let blades = noise(38.0 * x + 4.0 * y, 9.0 * y, 3);
    let patches = noise(3.0 * x, 5.0 * y, 3);
    let green = mix([0.10, 0.16, 0.05], [0.46, 0.50, 0.16], blades);
    let green = mix(green, [0.50, 0.36, 0.14], 0.7 * patches * patches);
    // Flowers on some cells of a lattice.
    let cell = [(x * 16.0).floor(), (y * 16.0).floor()];
    let [dx, dy] = [0, 1].map(|k| 0.3 + 0.4 * hash(cell[0] + 50.0 * k as f64, cell[1]));
    let off = (x * 16.0 - cell[0] - dx).hypot(y * 16.0 - cell[1] - dy);
    if hash(cell[0], cell[1] + 7.0) > 0.62 && off < 0.22 {
        return if hash(cell[0] + 3.0, cell[1]) > 0.5 {
            [0.92, 0.86, 0.9]
        } else {
            [0.86, 0.22, 0.2]
        };
    }
    green
}

/// A tree at the left, dark against the sky.
fn tree(x: f64, y: f64) -> Option<Colour> {
    let trunk = -0.62 + 0.04 * (4.0 * y).sin();
    let bark = noise(30.0 * x, 4.0 * y, 3);
    if y < 0.35 && (x - trunk).abs() < 0.035 + 0.03 * (-0.2 - y).max(0.0) {
        return Some(mix([0.13, 0.08, 0.05], [0.45, 0.30, 0.18], bark));
    }
    let crown = ((x + 0.62) / 0.36).hypot((y - 0.42) / 0.36);
    let leaves = noise(9.0 * x, 9.0 * y + 40.0, 4);
    (crown + 0.9 * (leaves - 0.5) < 0.85).then(|| {
        let light = noise(20.0 * x, 20.0 * y, 3) + 0.35 * (x + 0.62) + 0.3 * (y - 0.42);
        mix([0.06, 0.12, 0.05], [0.48, 0.52, 0.18], light.clamp(0.0, 1.0))
    })
}

fn mix(a: Colour, b: Colour, part: f64) -> Colour {
    [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]))
}

fn add(a: Colour, b: Colour, times: f64) -> Colour {
    [0, 1, 2].map(|k| a[k] + times * b[k])
}

/// Smooth noise in [0, 1], each octave at twice the pitch and half the strength of the one before.
fn noise(x: f64, y: f64, octaves: i32) -> f64 {
    let (mut sum, mut all) = (0.0, 0.0);
    for octave in 0..octaves {
        let (pitch, strength) = (2f64.powi(octave), 0.5f64.powi(octave));
        sum += strength * lattice(pitch * x + 17.0 * f64::from(octave), pitch * y);
        all += strength;
    }
    sum / all
}

/// Smooth interpolation of random numbers on a lattice.
fn lattice(x: f64, y: f64) -> f64 {
    let (left, low) = (x.floor(), y.floor());
    let [u, v] = [x - left, y - low].map(|t| t * t * (3.0 - 2.0 * t));
    let row = |y: f64| (1.0 - u) * hash(left, y) + u * hash(left + 1.0, y);
    (1.0 - v) * row(low) + v * row(low + 1.0)
}

/// A pseudorandom number in [0, 1) from two whole numbers.
fn hash(x: f64, y: f64) -> f64 {
    let mut bits = (x as i64 as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    bits ^= (y as i64 as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
    bits = (bits ^ (bits >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 32)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sky_is_above_and_the_picture_is_the_same_at_any_size() {
        let [small, large] = [8, 32].map(landscape);
        let mean = |pixels: &[Colour]| {
            let sum = pixels.iter().fold([0.0; 3], |sum, &pixel| add(sum, pixel, 1.0));
            sum.map(|sum| sum / pixels.len() as f64)
        };
        let ([_, _, blue], [_, green, grass_blue]) = (mean(&large[..64]), mean(&large[960..]));
        assert!(blue > 0.5 && green > grass_blue, "{blue} {green} {grass_blue}");
        let off = add(mean(&small), mean(&large), -1.0);
        assert!(off.iter().all(|x| x.abs() < 0.03), "{off:?}");
        assert!(small.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
    }
}
