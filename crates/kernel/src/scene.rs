//! Inputs of a traversal: those of the op in one number type, cut into bands.

use std::ops::Range;

use super::{
    bands::View,
    face::{Faces, Spans, prepare},
    float::Float as _,
    lanes::{GROUP, LANES, Lanes},
    reach::within,
    real::{Float, Real, Table, splat},
    table::{Grid, Lookup},
};
use crate::ImageSize;

/// All inputs of a traversal, in one number type.
pub(crate) struct Scene<'a, T: Real> {
    /// `[views, 3, vertices]`: x and y in NDC, depth.
    pub(crate) vertices: &'a [Float<T>],
    /// Tangents of the vertices, if the numbers have any.
    pub(crate) tangents: &'a [Float<T>],
    pub(crate) faces: &'a [[u32; 3]],
    /// Cubic coefficients of each cell, `[grid.rows()]`.
    pub(crate) table: Table<'a, T>,
    pub(crate) grid: Grid,
    pub(crate) size: ImageSize,
    pub(crate) lookup: Lookup<Float<T>>,
    /// Pixels in a unit of NDC.
    pub(crate) half: f64,
    /// Centres of the columns and of the rows, in NDC.
    columns: Vec<Float<T>>,
    heights: Vec<Float<T>>,
}

/// A band of a view.
#[derive(Clone, Copy)]
pub(crate) struct BandRef<'a, T: Real> {
    /// `[3, vertices]`.
    pub(crate) vertices: &'a [Float<T>],
    /// Tangents of the vertices, `[3, vertices]`, or empty.
    pub(crate) tangents: &'a [Float<T>],
    /// `[grid.rows()]`.
    pub(crate) table: Table<'a, T>,
    pub(crate) view: &'a View,
    pub(crate) band: usize,
    /// Faces that a walk visits, of those of the band.
    pub(crate) numbers: &'a [u32],
    /// Which list of the faces of the band a walk begins with.
    pub(crate) first_list: usize,
}

impl<T: Real> BandRef<'_, T> {
    /// Prepares up to [`LANES`] faces of the band, given by their numbers; the last one is repeated. The origin of each is the first column
    /// that it reaches, and its first row in this band.
    #[inline(always)]
    pub(crate) fn faces(
        &self,
        scene: &Scene<T>,
        numbers: &[u32],
        faces: &mut Faces<T>,
    ) -> Spans<T> {
        let nothing = [Float::<T>::ZERO; LANES];
        let (mut values, mut tangents) = ([[nothing; 3]; 2], [[nothing; 3]; 2]);
        let mut origin = [nothing; 2];
        let mut radii = [Float::<T>::from_f64(scene.grid.outer); LANES];
        let count = self.vertices.len() / 3;
        let (xs, ys) = (&self.vertices[..count], &self.vertices[count..2 * count]);
        let band = self.rows();
        for lane in 0..LANES {
            let number = numbers[lane.min(numbers.len() - 1)] as usize;
            let (face, reach) = (scene.faces[number], self.view.reaches[number]);
            origin[0][lane] = scene.columns[reach.left as usize];
            origin[1][lane] = scene.heights[within(band.clone(), reach).start];
            for k in 0..3 {
                let vertex = face[k] as usize;
                (values[0][k][lane], values[1][k][lane]) = (xs[vertex], ys[vertex]);
                if T::DUAL {
                    tangents[0][k][lane] = self.tangents[vertex];
                    tangents[1][k][lane] = self.tangents[count + vertex];
                }
            }
            if !self.view.radii.is_empty() {
                radii[lane] = Float::<T>::from_f64(f64::from(self.view.radii[number]));
            }
        }
        let (right, down) = (splat::<T::Lanes>(scene.half), splat::<T::Lanes>(-scene.half));
        let [left, top] = [T::Lanes::of(&origin[0]), T::Lanes::of(&origin[1])];
        let [x, y] = values;
        let [dx, dy] = tangents;
        let x = [
            placed(&x[0], &dx[0], left, right),
            placed(&x[1], &dx[1], left, right),
            placed(&x[2], &dx[2], left, right),
        ];
        let y = [
            placed(&y[0], &dy[0], top, down),
            placed(&y[1], &dy[1], top, down),
            placed(&y[2], &dy[2], top, down),
        ];
        prepare(x, y, T::Lanes::of(&radii) * right, scene.half, faces)
    }

    /// Rows of the image that the band holds.
    pub(crate) fn rows(&self) -> Range<usize> {
        self.view.rows(self.band)
    }

    /// Length of the band's buffers: its rows, and a group of unused pixels.
    pub(crate) fn length(&self, scene: &Scene<T>) -> usize {
        self.rows().len() * scene.stride() + GROUP
    }

    /// The constant of the profile outside its support.
    #[inline(always)]
    pub(crate) fn tail(&self, grid: &Grid) -> T {
        let tail = grid.tail();
        let tangent = if T::DUAL { self.table.tangents[tail][0] } else { Float::<T>::ZERO };
        T::new(T::Lanes::splat(self.table.values[tail][0]), T::Lanes::splat(tangent))
    }

    /// The sum at a pixel that no face reaches.
    pub(crate) fn empty(&self, grid: &Grid) -> Float<T> {
        let rows = if T::DUAL { self.table.tangents } else { self.table.values };
        rows[grid.tail()][0] * Float::<T>::from_f64(self.view.drawn as f64)
    }
}

/// Positions in pixels relative to an origin, with their tangents; `half` is the number of pixels in a unit.
#[inline(always)]
fn placed<T: Real>(
    values: &[Float<T>; LANES],
    tangents: &[Float<T>; LANES],
    origin: T::Lanes,
    unit: T::Lanes,
) -> T {
    T::new((T::Lanes::of(values) - origin) * unit, T::Lanes::of(tangents) * unit)
}

impl<'a, T: Real> Scene<'a, T> {
    pub(crate) fn new(
        vertices: [&'a [Float<T>]; 2],
        faces: &'a [[u32; 3]],
        table: Table<'a, T>,
        grid: Grid,
        size: ImageSize,
    ) -> Self {
        let number = Float::<T>::from_f64;
        let [vertices, tangents] = vertices;
        let half = 0.5 * size.shorter() as f64;
        Self {
            vertices,
            tangents,
            faces,
            table,
            grid,
            size,
            lookup: Lookup::new(&grid, half),
            half,
            columns: (0..size.width).map(|column| number(size.column_centre(column))).collect(),
            heights: (0..size.height).map(|row| number(size.row_centre(row))).collect(),
        }
    }

    /// A band of view `index` of `views`.
    pub(crate) fn place<'b>(
        &self,
        view: &'b View,
        index: usize,
        views: usize,
        band: usize,
    ) -> BandRef<'b, T>
    where
        'a: 'b,
    {
        let of_view = |numbers: &'a [Float<T>]| {
            let length = numbers.len() / views;
            &numbers[index * length..(index + 1) * length]
        };
        let [vertices, tangents] = [self.vertices, self.tangents].map(of_view);
        let numbers = view.faces(band);
        BandRef { vertices, tangents, table: self.table, view, band, numbers, first_list: 0 }
    }

    /// Length of a row of a band: that of the image, and a group for pixels beyond its end.
    pub(crate) fn stride(&self) -> usize {
        self.size.width + GROUP
    }
}
