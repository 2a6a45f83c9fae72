//! Charts beside each other on a square of texels.

use anyhow::{Context, ensure};
use softrast_mesh::Mesh;

use super::charts::{Chart, charts};

/// Texels around each chart that belong to it, so that what is read between texels is none of another's, in a picture of half the size too.
const MARGIN: f64 = 3.0;
/// The part of a square that charts cover at first; each try covers less, until all have room.
const COVERED: f64 = 0.9;
/// Factor of the texels for each world unit from one try to the next.
const SMALLER: f64 = 0.96;
/// Tries, the last with a hundredth of the texels for each world unit.
const TRIES: i32 = 113;

/// A mesh unwrapped: where the corners of its faces lie on a square picture.
///
/// The surface is cut into charts, connected parts that lie flat as seen along an axis of the world, and these lie beside each other, all in one scale and
/// with margins. No two faces cover the middle of one texel.
///
/// ```
/// use softrast_mesh::icosphere;
/// use softrast_views::Unwrapped;
///
/// let unwrapped = Unwrapped::of(&icosphere(3), 128)?;
/// assert_eq!(unwrapped.charts(), 6);
/// assert!(unwrapped.corners().as_flattened().as_flattened().iter().all(|x| (0.0..=128.0).contains(x)));
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Unwrapped {
    size: usize,
    charts: usize,
    corners: Vec<[[f64; 2]; 3]>,
}

impl Unwrapped {
    /// A layout on `size` × `size` texels, all charts in the same scale, as large as they find room.
    ///
    /// # Errors
    ///
    /// If the mesh has no area, or so many charts that their margins alone need more room.
    pub fn of(mesh: &Mesh, size: usize) -> anyhow::Result<Self> {
        let area = mesh.area();
        ensure!(area > 0.0 && area.is_finite(), "a mesh without an area has no texture");
        let unit = area.sqrt() / (COVERED.sqrt() * size as f64);
        let charts = charts(mesh, unit);
        let mut corners = vec![[[0.0; 2]; 3]; mesh.faces().len()];
        let first = 1.0 / unit;
        let placed = (0..TRIES).find_map(|k| {
            let scale = first * SMALLER.powi(k);
            Some((scale, packed(&charts, scale, size)?))
        });
        let (scale, offsets) = placed.with_context(|| {
            format!("a texture of {size} x {size} texels has no room for {} charts of {} faces: take a larger one", charts.len(), corners.len())
        })?;
        for (chart, offset) in charts.iter().zip(offsets) {
            for (&face, flat) in chart.faces.iter().zip(&chart.corners) {
                corners[face] = flat.map(|p| [0, 1].map(|k| scale * p[k] + offset[k]));
            }
        }
        Ok(Self { size, charts: charts.len(), corners })
    }

    /// Texels a side.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The number of charts.
    pub fn charts(&self) -> usize {
        self.charts
    }

    /// Corners of each face in texels, to the right and down from the corner above left.
    pub fn corners(&self) -> &[[[f64; 2]; 3]] {
        &self.corners
    }

    /// Places (u, v) of all corners, v up, those of the first face first.
    pub fn coordinates(&self) -> Vec<[f64; 2]> {
        let side = self.size as f64;
        self.corners.as_flattened().iter().map(|&[x, y]| [x / side, 1.0 - y / side]).collect()
    }
}

/// The outline of a chart: what it covers of each column of texels, margins included.
struct Outline {
    chart: usize,
    /// Offset of corners, so that the first texel is [0, 0].
    offset: [f64; 2],
    /// The first row of each column, and the one after its last.
    columns: Vec<[usize; 2]>,
    height: usize,
}

impl Outline {
    fn of(number: usize, chart: &Chart, scale: f64) -> Self {
        let corners = || chart.corners.iter().map(|flat| flat.map(|p| p.map(|x| scale * x)));
        let low = [0, 1].map(|k| corners().flatten().map(|p| p[k]).fold(f64::INFINITY, f64::min));
        // Whole texels stay whole, so that a chart lies on texels as it was checked for overlap.
        let offset = low.map(|low| MARGIN - low.floor());
        let mut columns: Vec<[usize; 2]> = Vec::new();
        for flat in corners() {
            let bounds = |k: usize| {
                let at = flat.map(|p| p[k] + offset[k]);
                let [low, high] =
                    [f64::min, f64::max].map(|pick| at.into_iter().reduce(pick).unwrap_or(0.0));
                [(low - MARGIN).floor().max(0.0) as usize, (high + MARGIN).ceil() as usize]
            };
            let ([left, right], [top, bottom]) = (bounds(0), bounds(1));
            if columns.len() < right {
                columns.resize(right, [usize::MAX, 0]);
            }
            for [first, end] in &mut columns[left..right] {
                (*first, *end) = ((*first).min(top), (*end).max(bottom));
            }
        }
        let height = columns.iter().map(|column| column[1]).max().unwrap_or(0);
        // A connected chart covers every column; one of faces apart may not.
        columns.iter_mut().filter(|column| column[1] == 0).for_each(|column| *column = [0, height]);
        Self { chart: number, offset, columns, height }
    }
}

/// Offset of the corners of each chart, after the factor `scale`; none if there is not enough room.
///
/// The highest chart comes first. Each lies on those before it, where it ends highest on the square, and among such places where it leaves least free below.
fn packed(charts: &[Chart], scale: f64, size: usize) -> Option<Vec<[f64; 2]>> {
    let mut outlines: Vec<Outline> =
        charts.iter().enumerate().map(|(k, chart)| Outline::of(k, chart, scale)).collect();
    outlines.sort_by_key(|outline| std::cmp::Reverse((outline.height, outline.columns.len())));
    let mut horizon = vec![0usize; size];
    let mut offsets = vec![[0.0; 2]; charts.len()];
    for outline in outlines {
        let wide = outline.columns.len();
        let last = size.checked_sub(wide)?;
        let place = |left: usize| {
            let below = || horizon[left..left + wide].iter().zip(&outline.columns);
            let top = below().map(|(&taken, [first, _])| taken.saturating_sub(*first)).max()?;
            let free: usize = below().map(|(&taken, [first, _])| top + first - taken).sum();
            (top + outline.height <= size).then_some((top + outline.height, free, left, top))
        };
        let step = (wide / 16).max(1);
        let (_, _, left, top) = (0..=last).step_by(step).filter_map(place).min()?;
        for (taken, [_, end]) in horizon[left..].iter_mut().zip(&outline.columns) {
            *taken = top + end;
        }
        let [x, y] = outline.offset;
        offsets[outline.chart] = [x + left as f64, y + top as f64];
    }
    Some(offsets)
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::{super::triangle::covered_texels, *};

    #[test]
    fn charts_keep_their_margins_and_fill_almost_half() {
        let ball = icosphere(4);
        let layout = Unwrapped::of(&ball, 256).unwrap();
        assert_eq!(layout.charts, 6);
        let mut owner = vec![usize::MAX; 256 * 256];
        let charts = charts(&ball, ball.area().sqrt() / (COVERED.sqrt() * 256.0));
        let mut covered = 0;
        for (number, chart) in charts.iter().enumerate() {
            for &face in &chart.faces {
                covered_texels(layout.corners[face], |[x, y], _| {
                    let texel = y as usize * 256 + x as usize;
                    assert_eq!(owner[texel], usize::MAX, "two faces on one texel");
                    (owner[texel], covered) = (number, covered + 1);
                });
            }
        }
        assert!(covered > 29_000, "{covered} of 65536");
        for y in 2..254 {
            for x in 2..254 {
                let own = owner[y * 256 + x];
                for other in [owner[y * 256 + x + 2], owner[(y + 2) * 256 + x]] {
                    assert!(own == usize::MAX || other == usize::MAX || own == other);
                }
            }
        }
        // All in one scale: a face is as long as in the world but for its slope.
        assert!(layout.coordinates().as_flattened().iter().all(|x| (0.0..=1.0).contains(x)));
    }

    #[test]
    fn too_many_charts_for_the_texels_are_an_error() {
        let ball = icosphere(3);
        // Faces apart from each other: each is a chart.
        let positions = ball.triangles().flatten().collect();
        let faces = (0..1280u32).map(|face| [0, 1, 2].map(|k| 3 * face + k)).collect();
        let apart = Mesh::new(positions, faces).unwrap();
        let error = Unwrapped::of(&apart, 64).err().unwrap().to_string();
        assert!(error.contains("64 x 64 texels has no room for 1280 charts"), "{error}");
        assert_eq!(Unwrapped::of(&apart, 512).unwrap().charts, 1280);
    }
}
