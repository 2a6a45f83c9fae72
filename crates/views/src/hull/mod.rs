//! The visual hull: the space that no mask excludes.
//!
//! Source: Laurentini 1994.

use anyhow::{Context, ensure};
use rayon::prelude::*;
use softrast_mesh::{
    Mesh,
    vectors::{difference, norm},
};
use softrast_raster::Pinhole;

use self::cone::Cone;
use crate::{Frame, View};

mod cone;

/// Cells along each side of the first grid.
const COARSE: usize = 40;

/// Number of other masks that must show something a single mask excludes.
const WITNESSES: usize = 2;

/// The visual hull of the masks, except faults of single ones, as a mesh in world units of the cameras: closed, counterclockwise from
/// outside, without components of fewer faces than a fiftieth of the largest. The bounding box of the hull has `cells` cells, at least one,
/// along its longest side.
///
/// A point that only one mask excludes belongs to the hull if two others show something there that the hull lacks. A hole in one mask
/// therefore does not cut through the object.
///
/// # Errors
///
/// The errors of [`frame_of_masks`]; and if no solid has these masks.
pub fn visual_hull(views: &[View], cells: usize) -> anyhow::Result<Mesh> {
    VisualHull::new(views)?.mesh(cells)
}

/// The space that masks exclude, to make [`visual_hull`]s of it with several numbers of cells.
///
/// ```
/// use softrast_mesh::icosphere;
/// use softrast_raster::Pinhole;
/// use softrast_views::{Picture, View, VisualHull, coloured_pixels};
///
/// let views = [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]].map(|eye| {
///     let camera = Pinhole::look_at(eye, [0.0; 3], [1.0; 3], 40.0, 32);
///     let [.., covered] = coloured_pixels(&icosphere(2), &camera);
///     let mask = Picture::new(covered.iter().map(|&part| part as f32).collect(), 32);
///     View { name: "ball".into(), picture: "".into(), mask, camera, distortion: None, off: 0.0 }
/// });
/// let hull = VisualHull::new(&views)?;
/// let [rough, fine] = [10, 20].map(|cells| hull.mesh(cells));
/// assert!(rough?.faces().len() < fine?.faces().len());
/// # anyhow::Ok(())
/// ```
pub struct VisualHull<'a> {
    cones: Vec<Cone<'a>>,
    centre: [f64; 3],
    reach: f64,
}

impl<'a> VisualHull<'a> {
    /// Prepares the masks of these views.
    ///
    /// # Errors
    ///
    /// The errors of [`frame_of_masks`].
    pub fn new(views: &'a [View]) -> anyhow::Result<Self> {
        let cones = views.par_iter().map(Cone::new).collect::<anyhow::Result<Vec<_>>>()?;
        let (centre, reach) = region(&cones)?;
        Ok(Self { cones, centre, reach })
    }

    /// The [`visual_hull`] with `cells` cells along its longest side.
    ///
    /// # Errors
    ///
    /// If no solid has these masks.
    pub fn mesh(&self, cells: usize) -> anyhow::Result<Mesh> {
        let Self { cones, centre, reach } = self;
        let (centre, reach) = (*centre, *reach);
        let field = |p: [f64; 3]| {
            cones.iter().map(|cone| cone.distance(p)).fold(-reach, f64::max).min(reach)
        };
        let strict = solid(centre, reach, cells, field)?;
        let lacking: Vec<Vec<bool>> = cones.par_iter().map(|cone| cone.lacking(&strict)).collect();
        if lacking.iter().filter(|cells| cells.contains(&true)).count() < WITNESSES {
            return Ok(strict);
        }
        let slack = 2.0 * reach / cells.max(1) as f64;
        solid(centre, reach, cells, |p: [f64; 3]| {
            let [mut farthest, mut second] = [-reach; 2];
            for distance in cones.iter().map(|cone| cone.distance(p)) {
                second = second.max(farthest.min(distance));
                farthest = farthest.max(distance);
            }
            let lacks =
                |(cone, cells): &(&Cone, &Vec<bool>)| cone.cell(p).is_some_and(|k| cells[k]);
            let is_ruled_out_once = farthest > 0.0 && second < slack;
            match is_ruled_out_once && cones.iter().zip(&lacking).filter(lacks).count() >= WITNESSES
            {
                true => second,
                false => farthest.min(reach),
            }
        })
    }
}

/// The solid in a cube where a field is negative, without specks; its bounding box has `cells` cells along its longest side.
fn solid(
    centre: [f64; 3],
    reach: f64,
    cells: usize,
    field: impl Fn([f64; 3]) -> f64 + Sync,
) -> anyhow::Result<Mesh> {
    // Extent of the solid on a coarse grid.
    let step = 2.0 * reach / COARSE as f64;
    let at = |k: usize| {
        let cell = [k % COARSE, k / COARSE % COARSE, k / COARSE / COARSE];
        [0, 1, 2].map(|i| centre[i] - reach + (cell[i] as f64 + 0.5) * step)
    };
    let inside = (0..COARSE.pow(3)).into_par_iter().map(at).filter(|&p| field(p) < 0.5 * step);
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let around = |[low, high]: [[f64; 3]; 2], [lower, higher]: [[f64; 3]; 2]| {
        [[0, 1, 2].map(|k| low[k].min(lower[k])), [0, 1, 2].map(|k| high[k].max(higher[k]))]
    };
    let [low, high] = inside.map(|p| [p; 2]).reduce(|| none, around);
    ensure!(
        low[0] <= high[0],
        "no solid has these masks: cameras and pictures do not belong together, or masks are inverted"
    );
    let (low, high) = (low.map(|x| x - step), high.map(|x| x + step));
    let hull = Mesh::of_solid([low, high], cells, field);
    without_specks(hull.context("the visual hull is no mesh")?)
}

/// Removes components of fewer faces than a fiftieth of the largest: artefacts between the cones of few views.
fn without_specks(mesh: Mesh) -> anyhow::Result<Mesh> {
    // Each vertex points to another of its component, the last one to itself.
    let mut next: Vec<usize> = (0..mesh.positions().len()).collect();
    fn last(next: &mut [usize], mut vertex: usize) -> usize {
        while next[vertex] != vertex {
            next[vertex] = next[next[vertex]];
            vertex = next[vertex];
        }
        vertex
    }
    for face in mesh.faces() {
        let [a, b, c] = face.map(|vertex| last(&mut next, vertex as usize));
        next[b] = a;
        let c = last(&mut next, c);
        next[c] = a;
    }
    let part: Vec<usize> =
        mesh.faces().iter().map(|face| last(&mut next, face[0] as usize)).collect();
    let mut faces_of = vec![0; next.len()];
    part.iter().for_each(|&part| faces_of[part] += 1);
    let largest = faces_of.iter().copied().max().unwrap_or(0);
    let kept = mesh.faces().iter().zip(&part).filter(|(_, part)| 50 * faces_of[**part] >= largest);
    let kept: Vec<[u32; 3]> = kept.map(|(face, _)| *face).collect();
    // Removes unused vertices, which would be moved and written for nothing.
    let mut number = vec![u32::MAX; next.len()];
    let mut positions = Vec::new();
    let faces = kept.iter().map(|face| {
        face.map(|vertex| {
            let number = &mut number[vertex as usize];
            if *number == u32::MAX {
                *number = positions.len() as u32;
                positions.push(mesh.positions()[vertex as usize]);
            }
            *number
        })
    });
    let faces = faces.collect();
    Ok(Mesh::new(positions, faces)?)
}

/// The frame whose unit ball around the origin contains the objects in the masks: its middle is the point nearest to the lines of sight
/// through the middles of the masks, except masks cut off by their picture unless most are. Position and size thus come from the pictures,
/// whatever the units and the origin of the cameras.
///
/// # Errors
///
/// If there is no view, a mask is empty or full, the cameras do not look at one thing from at least two directions, or a camera is inside
/// the object or has it behind it: with the name of the view.
pub fn frame_of_masks(views: &[View]) -> anyhow::Result<Frame> {
    let cones = views.par_iter().map(Cone::new).collect::<anyhow::Result<Vec<_>>>()?;
    let (middle, unit) = region(&cones)?;
    Ok(Frame { middle, unit })
}

fn region(cones: &[Cone<'_>]) -> anyhow::Result<([f64; 3], f64)> {
    // Relative to one of the cameras, so that no digits are lost far from the origin.
    let origin = eye(&cones.first().context("there is no view")?.view.camera)?;
    let mut matrix = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    // The middle of a mask that its picture cuts off is biased. If most are cut off, they are used anyway.
    let whole = cones.iter().filter(|cone| !cone.cut).count();
    for cone in cones.iter().filter(|cone| !cone.cut || 2 * whole < cones.len()) {
        let eye = eye(&cone.view.camera)?;
        let (eye, ray) = (difference(eye, origin), cone.ray());
        for i in 0..3 {
            for j in 0..3 {
                let across = f64::from(u8::from(i == j)) - ray[i] * ray[j];
                matrix[i][j] += across;
                right[i] += across * eye[j];
            }
        }
    }
    let middle = solved(matrix, right).context(
        "the cameras do not tell how far away the object is: give views from at least two directions",
    )?;
    let middle = [0, 1, 2].map(|k| origin[k] + middle[k]);
    let depth = |view: &View| view.camera.transform(middle)[2];
    let reach_of = |Cone { view, white, .. }: &Cone<'_>| {
        let [fx, fy] = view.camera.focal;
        // Half the diagonal of the mask.
        white * std::f64::consts::FRAC_1_SQRT_2 * depth(view) / fx.min(fy)
    };
    let reach = cones.iter().map(reach_of).fold(0.0, f64::max);
    for view in cones.iter().map(|cone| cone.view) {
        ensure!(
            norm(view.camera.transform(middle)) > 0.5 * reach,
            "{}: the camera is inside the object that the other masks show: check its transform_matrix",
            view.name
        );
        ensure!(
            depth(view) > 0.0,
            "{}: the camera has the object behind it: check the convention of transform_matrix (camera to world; x right, y up, z behind)",
            view.name
        );
    }
    Ok((middle, reach))
}

/// Position of a camera. Far from the origin, rounding of a rotation in a file would move the product with its transpose.
fn eye(camera: &Pinhole) -> anyhow::Result<[f64; 3]> {
    solved(camera.rotation, camera.translation.map(|x| -x)).context("a rotation has an inverse")
}

/// The solution of three linear equations, unless they are nearly dependent.
fn solved(matrix: [[f64; 3]; 3], right: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = |m: [[f64; 3]; 3]| {
        (0..3)
            .map(|k| {
                m[0][k]
                    * (m[1][(k + 1) % 3] * m[2][(k + 2) % 3]
                        - m[1][(k + 2) % 3] * m[2][(k + 1) % 3])
            })
            .sum::<f64>()
    };
    let whole = determinant(matrix);
    let trace = matrix[0][0] + matrix[1][1] + matrix[2][2];
    let with = |column: usize| {
        let mut m = matrix;
        (0..3).for_each(|row| m[row][column] = right[row]);
        determinant(m) / whole
    };
    (whole > 1e-6 * trace.powi(3)).then(|| [with(0), with(1), with(2)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coloured_pixels;

    const CENTRE: [f64; 3] = [4e5, 2.0, -7.0];

    /// Views of a ball of radius 3, from directions.
    fn of_ball<const N: usize>(away: [[f64; 3]; N]) -> Vec<View> {
        let ball = softrast_mesh::icosphere(2);
        let place = |p: &[f64; 3]| [0, 1, 2].map(|k| CENTRE[k] + 3.0 * p[k]);
        let ball = ball.with_positions(ball.positions().iter().map(place).collect()).unwrap();
        let view = |(k, away): (usize, [f64; 3])| {
            let eye = [0, 1, 2].map(|k| CENTRE[k] + 12.0 * away[k]);
            let camera = Pinhole::look_at(eye, CENTRE, [0.1, 1.0, 0.2], 40.0, 96);
            let [.., covered] = coloured_pixels(&ball, &camera);
            let mask = crate::Picture::new(covered.iter().map(|&part| part as f32).collect(), 96);
            let (name, picture) = (k.to_string(), "a".into());
            View { name, picture, mask, camera, distortion: None, off: 0.0 }
        };
        away.into_iter().enumerate().map(view).collect()
    }

    #[test]
    fn a_hole_in_one_mask_does_not_cut_through_the_object() {
        let away = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [0.0, 0.8, 0.6]];
        let mut views = of_ball(away);
        let whole = visual_hull(&views, 40).unwrap();
        // The first mask lacks everything below its middle.
        let mut levels = views[0].mask.pixels().to_vec();
        levels[52 * 96..].fill(0.0);
        views[0].mask = crate::Picture::new(levels, 96);
        let found = visual_hull(&views, 40).unwrap();
        let [[expected, _], [low, high]] = [whole.bounds(), found.bounds()];
        assert!((low[1] - expected[1]).abs() < 0.5, "{low:?}, not {expected:?}");
        assert!(high[1] - low[1] > 5.5, "{low:?} to {high:?}");
        // If two masks lack it, the conflict is undecided.
        let mut levels = views[1].mask.pixels().to_vec();
        levels[52 * 96..].fill(0.0);
        views[1].mask = crate::Picture::new(levels, 96);
        let [low, high] = visual_hull(&views, 40).unwrap().bounds();
        assert!(high[1] - low[1] < 4.5, "{low:?} to {high:?}");
    }

    #[test]
    fn a_ball_is_found_from_its_silhouettes() {
        let away = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.8, 0.0], [0.0, 0.6, -0.8]];
        let (views, centre) = (of_ball(away), CENTRE);
        let frame = frame_of_masks(&views).unwrap();
        assert!((0..3).all(|k| (frame.middle[k] - centre[k]).abs() < 0.1), "{frame:?}");
        assert!((3.0..5.0).contains(&frame.unit), "{frame:?}");
        let [low, high] = visual_hull(&views, 40).unwrap().bounds();
        for k in 0..3 {
            // The hull contains the ball, up to part of a cell, and four views leave slightly more.
            assert!((2.8..4.0).contains(&(high[k] - centre[k])), "{high:?}");
            assert!((2.8..4.0).contains(&(centre[k] - low[k])), "{low:?}");
        }
        let said = |views: &[View]| visual_hull(views, 40).unwrap_err().to_string();
        assert_eq!(said(&[]), "there is no view");
        let of = |level: f32| {
            let mut views = views.clone();
            views[1].mask = crate::Picture::new(vec![level; 96 * 96], 96);
            format!("{:#}", visual_hull(&views, 40).unwrap_err())
        };
        assert!(of(0.0).starts_with("1: the mask is empty"), "{}", of(0.0));
        assert!(of(1.0).starts_with("1: the mask is full"), "{}", of(1.0));
    }

    #[test]
    fn equations_have_a_solution_unless_one_says_what_others_say() {
        let m = [[2.0, 0.0, 1.0], [0.0, 3.0, 0.0], [1.0, 0.0, 2.0]];
        let x = solved(m, [5.0, 6.0, 7.0]).unwrap();
        assert!((0..3).all(|k| (x[k] - [1.0, 2.0, 3.0][k]).abs() < 1e-12));
        assert_eq!(solved([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]], [1.0; 3]), None);
    }
}
