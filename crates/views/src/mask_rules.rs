use anyhow::{anyhow, ensure};

use crate::picture_file::Pixel;

/// Conversion of the levels of a picture to a mask.
///
/// ```
/// use softrast_views::{MaskRules, Picture, PictureFile};
///
/// let grey = image::GrayImage::from_raw(2, 1, vec![0, 255]).unwrap();
/// let mut png = std::io::Cursor::new(Vec::new());
/// grey.write_to(&mut png, image::ImageFormat::Png)?;
/// let file = PictureFile::decode(png.get_ref())?;
/// let mask = |rules| anyhow::Ok(Picture::mask_of(&file, &rules)?.pixels().to_vec());
/// let plain = MaskRules::default();
/// assert_eq!(mask(plain)?, [0.0, 1.0]);
/// assert_eq!(mask(MaskRules { invert: true, ..plain })?, [1.0, 0.0]);
/// assert_eq!(mask(MaskRules { label: Some(0), ..plain })?, [1.0, 0.0]);
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaskRules {
    /// Whether black pixels are the mask.
    pub invert: bool,
    /// Least level of the mask, from 0 to 1, after inversion. `None` keeps soft edges.
    pub threshold: Option<f64>,
    /// Pixels of the class with this number are the mask: an index into the palette of a picture, or its level as an integer.
    pub label: Option<u32>,
}

/// Fraction of coloured pixels, and of pixels that are neither black nor white among those not black, above which a picture is not a mask.
const COLOURED: f64 = 0.05;
const GREY: f64 = 0.5;
/// Least difference between red, green and blue of a coloured pixel, and largest level of a black one; white ones have at least 1 minus
/// that.
const COLOUR: f32 = 0.25;
const BLACK: f32 = 0.1;

/// Numbers of pixels of a picture that look like those of a photograph.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Looks {
    pixels: usize,
    coloured: usize,
    grey: usize,
    black: usize,
}

impl Looks {
    /// Counts a pixel.
    pub(crate) fn see(&mut self, [red, green, blue, _]: Pixel) {
        let (least, most) = (red.min(green).min(blue), red.max(green).max(blue));
        self.pixels += 1;
        self.coloured += usize::from(most - least > COLOUR);
        self.black += usize::from(most <= BLACK);
        self.grey += usize::from(most > BLACK && least < 1.0 - BLACK);
    }

    /// An error if most pixels look like those of a photograph.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let share = |part: usize, of: usize| part as f64 / of.max(1) as f64;
        let coloured = share(self.coloured, self.pixels);
        let grey = share(self.grey, self.pixels - self.black);
        let told = match coloured > COLOURED {
            true => format!("{:.0} % of its pixels have a colour", 100.0 * coloured),
            false => format!("{:.0} % of what is not black is grey", 100.0 * grey),
        };
        ensure!(
            coloured <= COLOURED && grey <= GREY,
            "it looks like a photograph, not like a mask: {told}. Name a folder of masks with --masks, the class with --label N, or take what is \
             bright with --threshold X"
        );
        Ok(())
    }
}

/// Statistics of the levels of a picture, as needed for a mask.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelRange {
    darkest: f32,
    brightest: f32,
    /// The largest level below the brightest, and the least above the darkest, if there are any.
    next: [Option<f32>; 2],
}

impl Default for LevelRange {
    fn default() -> Self {
        Self { darkest: f32::INFINITY, brightest: f32::NEG_INFINITY, next: [None; 2] }
    }
}

impl LevelRange {
    /// Records the level of a pixel.
    pub(crate) fn see(&mut self, level: f32) {
        if level == self.darkest || level == self.brightest {
            return;
        }
        let [below, above] = &mut self.next;
        let before = (self.darkest.is_finite()).then_some([self.darkest, self.brightest]);
        let Some([darkest, brightest]) = before else {
            (self.darkest, self.brightest) = (level, level);
            return;
        };
        *below = match level > brightest {
            true => Some(brightest),
            false => Some(below.map_or(level, |next| next.max(level))),
        };
        *above = match level < darkest {
            true => Some(darkest),
            false => Some(above.map_or(level, |next| next.min(level))),
        };
        self.darkest = darkest.min(level);
        self.brightest = brightest.max(level);
    }

    pub(crate) fn brightest(&self) -> f32 {
        self.brightest
    }

    /// The statistics after inversion.
    fn inverted(self) -> Self {
        let [below, above] = self.next.map(|next| next.map(|level| 1.0 - level));
        Self { darkest: 1.0 - self.brightest, brightest: 1.0 - self.darkest, next: [above, below] }
    }

    /// The only level that is not 0, if there is just one and it is not 1.
    fn only(&self) -> Option<f32> {
        let two = self.darkest == 0.0 && self.next[0] == Some(0.0);
        (two && self.brightest < 1.0).then_some(self.brightest)
    }
}

/// Maps a level of the file to one of the mask.
type Change = Box<dyn Fn(f32) -> f32>;

impl MaskRules {
    /// The mapping of levels of the file, and the level that becomes white if it is the only one.
    ///
    /// # Errors
    ///
    /// If no pixel would be half white.
    pub(crate) fn change(&self, levels: &LevelRange) -> anyhow::Result<(Change, Option<f32>)> {
        let invert = self.invert;
        let told = move |level: f32| if invert { 1.0 - level } else { level };
        let of_mask = if invert { levels.inverted() } else { *levels };
        if let Some(threshold) = self.threshold {
            let taken = move |level: f32| f64::from(told(level)) >= threshold;
            ensure!(
                f64::from(of_mask.brightest) >= threshold,
                "the mask is empty: no level reaches the threshold {threshold}{}",
                advice(&of_mask)
            );
            return Ok((Box::new(move |level| f32::from(u8::from(taken(level)))), None));
        }
        // A mask of 0 and 1 is detected before inversion.
        if let Some(only) = levels.only() {
            let white = move |level: f32| f32::from(u8::from((level > 0.0) != invert));
            return Ok((Box::new(white), Some(only)));
        }
        if let Some(only) = of_mask.only() {
            let white = move |level: f32| f32::from(u8::from(told(level) > 0.0));
            return Ok((Box::new(white), Some(only)));
        }
        if of_mask.brightest < 0.5 {
            return Err(anyhow!(
                "the mask is empty: no pixel is half white or more{}",
                advice(&of_mask)
            ));
        }
        Ok((Box::new(told), None))
    }
}

/// The brightest level, and a threshold that includes it.
fn advice(levels: &LevelRange) -> String {
    let LevelRange { brightest, next: [below, _], .. } = *levels;
    match below {
        None if brightest == 0.0 => ", all are black".to_owned(),
        None => format!(", all have the level {brightest:.4} (1 is white)"),
        Some(below) => format!(
            ", and the brightest level is {brightest:.4} (1 is white): --threshold {} takes it alone",
            between(below, brightest)
        ),
    }
}

/// The number with the fewest digits above `low` and up to `high`.
fn between(low: f32, high: f32) -> f64 {
    let [low, high] = [low, high].map(f64::from);
    let rounded = |digits: i32| (high * 10f64.powi(digits)).floor() / 10f64.powi(digits);
    // Few digits, if the levels are far enough apart.
    (3..=9).map(rounded).find(|&x| x > low && x > 0.0).unwrap_or(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(all: &[f32]) -> LevelRange {
        let mut levels = LevelRange::default();
        all.iter().for_each(|&level| levels.see(level));
        levels
    }

    fn mask(rules: MaskRules, all: &[f32]) -> Result<(Vec<f32>, Option<f32>), String> {
        let (change, only) = rules.change(&levels(all)).map_err(|error| error.to_string())?;
        Ok((all.iter().map(|&level| change(level)).collect(), only))
    }

    const PLAIN: MaskRules = MaskRules { invert: false, threshold: None, label: None };
    const INVERTED: MaskRules = MaskRules { invert: true, ..PLAIN };

    #[test]
    fn one_level_above_black_and_nothing_else_is_the_mask() {
        for only in [1.0 / 255.0, 255.0 / 65535.0, 0.3, 0.502, 0.996] {
            let expected = Ok((vec![0.0, 1.0, 0.0], Some(only)));
            assert_eq!(mask(PLAIN, &[0.0, only, 0.0]), expected);
            assert_eq!(mask(PLAIN, &[only, 0.0]).unwrap().0, [1.0, 0.0]);
            // An inverted mask, and a picture whose object is slightly darker than white.
            assert_eq!(mask(INVERTED, &[0.0, only]).unwrap().0, [1.0, 0.0]);
            assert_eq!(mask(INVERTED, &[1.0, only]).unwrap().0, [0.0, 1.0]);
        }
        assert_eq!(mask(PLAIN, &[0.0, 1.0, 0.0]), Ok((vec![0.0, 1.0, 0.0], None)));
        assert_eq!(mask(PLAIN, &[0.0, 0.3, 0.9]), Ok((vec![0.0, 0.3, 0.9], None)));
    }

    #[test]
    fn photographs_look_like_none() {
        let check = |pixels: &[[f32; 3]]| {
            let mut looks = Looks::default();
            pixels.iter().for_each(|&[r, g, b]| looks.see([r, g, b, 1.0]));
            looks.check().map_err(|error| error.to_string())
        };
        let (black, white, grey) = ([0.0; 3], [1.0; 3], [0.4; 3]);
        assert_eq!(check(&[black, white, grey, white, black]), Ok(()));
        assert_eq!(check(&[black; 9]), Ok(()));
        assert!(check(&[black, white, grey, grey, grey]).unwrap_err().contains("75 % of what is"));
        let error = check(&[black, white, [0.9, 0.3, 0.3], black]).unwrap_err();
        assert!(error.contains("25 % of its pixels have a colour"), "{error}");
        assert_eq!(error.lines().count(), 1);
    }

    #[test]
    fn a_threshold_takes_levels_as_they_are() {
        let rules = MaskRules { threshold: Some(0.2), ..PLAIN };
        assert_eq!(mask(rules, &[0.0, 0.1, 0.2]), Ok((vec![0.0, 0.0, 1.0], None)));
        let rules = MaskRules { invert: true, ..rules };
        assert_eq!(mask(rules, &[0.0, 0.9]), Ok((vec![1.0, 0.0], None)));
    }

    #[test]
    fn an_empty_mask_names_its_brightest_level_and_the_threshold_that_takes_it() {
        let of_bytes = |all: &[u8]| all.iter().map(|&x| f32::from(x) / 255.0).collect::<Vec<_>>();
        for all in [vec![0, 1, 2, 3], vec![0, 3, 2, 60], vec![100, 101], vec![9, 8, 7, 0]] {
            let all = of_bytes(&all);
            let error = mask(PLAIN, &all).unwrap_err();
            let brightest = all.iter().copied().fold(0.0, f32::max);
            assert!(error.contains(&format!("{brightest:.4}")), "{error}");
            let (_, rest) = error.split_once("--threshold ").unwrap();
            let threshold = rest.split(' ').next().unwrap().parse().unwrap();
            let rules = MaskRules { threshold: Some(threshold), ..PLAIN };
            let (found, _) = mask(rules, &all).unwrap();
            let expected: Vec<f32> =
                all.iter().map(|&x| f32::from(u8::from(x == brightest))).collect();
            assert_eq!(found, expected, "{error}");
        }
        assert!(mask(PLAIN, &[0.0, 0.0]).unwrap_err().contains("all are black"));
        assert!(mask(PLAIN, &[0.2, 0.2]).unwrap_err().contains("all have the level 0.2000"));
        let high = MaskRules { threshold: Some(0.5), ..PLAIN };
        assert!(mask(high, &[0.0, 0.4]).unwrap_err().contains("--threshold 0.4 takes it"));
    }
}
