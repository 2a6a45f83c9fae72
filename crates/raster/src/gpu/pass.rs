//! One call of the op: which kernels run over which buffers.

use softrast_kernel::Grid;
use softrast_tensor::{
    DType, TensorMetadata,
    wgpu::{
        CubeTensor, WgpuRuntime,
        cubecl::{calculate_cube_count_elemwise, prelude::*},
        into_contiguous, zeros_client,
    },
};

use super::{
    cells::{CellsLaunch, fill_cells},
    frame::FrameLaunch,
    gradient::{UNITS, sum_faces, sum_vertices},
    image::sum_pixels,
    pair::LookupLaunch,
    reach::{count_drawn, prepare},
    table::{sum_cubics, sum_tables},
    tile::TILE,
    topology::OnDevice,
};

use crate::{ImageSize, ProfileSum};

pub(super) type Buffer = CubeTensor<WgpuRuntime>;

/// Largest buffer of a pass's own, in bytes: half of what every adapter can bind (128 MiB).
const BUFFER: usize = 64 << 20;
/// All tables of [`sum_cubics`] together, in bytes.
const TABLES: usize = 32 << 20;
/// Units of a cube where they do not share anything.
pub(super) const CUBE: u32 = 64;

/// Inputs of a pass on the device.
pub(super) struct Pass<'a> {
    pub(super) op: &'a ProfileSum,
    pub(super) client: ComputeClient<WgpuRuntime>,
    /// `[views, 3, vertices]`.
    pub(super) vertices: Buffer,
    /// `[rows, 4]`, or `[views, rows, 4]`.
    table: Buffer,
    /// Whether each view has a table of its own.
    /// Derivatives of both, flat and in this order, in a pass of second order.
    direction: Option<Buffer>,
    pub(super) topology: OnDevice,
    pub(super) views: usize,
    pub(super) vertex_count: usize,
    /// Width and height of a cell in pixels.
    side: usize,
    /// Whether what is prepared of faces has their depths.
    depths: bool,
    /// Faces beyond this depth are not drawn.
    far: f32,
}

/// Some of the views, culled.
pub(super) struct Culled {
    pub(super) first_view: usize,
    pub(super) views: usize,
    pub(super) corners: Buffer,
    pub(super) reaches: Buffer,
    pub(super) cells: Buffer,
}

/// Tables of the units that add up the gradient to one.
pub(super) struct Partial {
    pub(super) cubes: usize,
    units: usize,
    /// Numbers of a table.
    coefficients: usize,
    /// `[units, rows, 4]`.
    pub(super) tables: Buffer,
}

impl<'a> Pass<'a> {
    pub(super) fn new(
        op: &'a ProfileSum,
        vertices: Buffer,
        table: Buffer,
        direction: Option<Buffer>,
    ) -> Self {
        assert_eq!(vertices.dtype(), DType::F32, "profile_sum on the GPU works in f32");
        let (client, device) = (vertices.client.clone(), vertices.device.clone());
        let (views, vertex_count) = (vertices.shape()[0], vertices.shape()[2]);
        let topology = op.topology.on(&op.faces, vertex_count, &client, &device);
        let mut side = TILE as usize;
        while op.size.height.div_ceil(side) * op.size.width.div_ceil(side) * words(op) * 4 > BUFFER
        {
            side *= 2;
        }
        Self {
            op,
            client,
            vertices: into_contiguous(vertices),
            table: into_contiguous(table),
            direction: direction.map(into_contiguous),
            topology,
            views,
            vertex_count,
            side,
            depths: false,
            far: f32::INFINITY,
        }
    }

    /// With the depths of faces, none of which is drawn beyond `far`.
    pub(super) fn with_depths(self, far: f32) -> Self {
        Self { depths: true, far, ..self }
    }

    /// Sums of the profile, flat: `[views * height * width]`.
    pub(super) fn sums(&self) -> Buffer {
        let sums = self.buffer(self.pixels(), DType::F32);
        for culled in self.culled() {
            self.write_sums(&culled, &sums, 0);
        }
        sums
    }

    /// Gradient of `Σ upstream · sums` to vertices and table, flat. In a pass of second order its
    /// derivative, and behind it that of the sums.
    pub(super) fn gradient(&self, upstream: Buffer, wrt_table: bool) -> Buffer {
        let upstream = into_contiguous(upstream);
        let coordinates = 3 * self.views * self.vertex_count;
        let coefficients = 4 * self.rows();
        let sums = if self.second() { self.pixels() } else { 0 };
        let length = coordinates + coefficients + sums;
        // Where the table has no part, its gradient stays 0.
        let gradient = if wrt_table && self.vertex_count > 0 {
            self.buffer(length, DType::F32)
        } else {
            self.zeros(length, DType::F32)
        };
        let partial = wrt_table.then(|| self.partial(self.views, self.rows()));
        for culled in self.culled() {
            self.write_corners(&culled, &upstream, &gradient);
            if let Some(partial) = &partial {
                self.add_cubics(&culled, &upstream, partial);
            }
            if self.second() {
                self.write_sums(&culled, &gradient, coordinates + coefficients);
            }
        }
        if let Some(partial) = partial {
            self.add_up(partial, &gradient, coordinates);
        }
        gradient
    }

    /// Tables of so many rows for units that walk over some views.
    pub(super) fn partial(&self, views: usize, rows: usize) -> Partial {
        let ImageSize { height, width } = self.op.size;
        let tiles = views * height.div_ceil(TILE as usize) * width.div_ceil(TILE as usize);
        let (cube, coefficients) = ((TILE * TILE) as usize, 4 * rows);
        let cubes = (TABLES / (4 * coefficients * cube)).clamp(1, tiles.max(1));
        let units = cubes * cube;
        let tables = self.zeros(units * coefficients, DType::F32);
        Partial { cubes, units, coefficients, tables }
    }

    /// Adds up the tables of all units into `gradient`, from `offset` on.
    pub(super) fn add_up(&self, partial: Partial, gradient: &Buffer, offset: usize) {
        let Partial { units, coefficients, tables, .. } = partial;
        sum_tables::launch(
            &self.client,
            self.cubes(coefficients, CUBE),
            CubeDim::new_1d(CUBE),
            tables.into_array_arg(),
            gradient.clone().into_array_arg(),
            units as u32,
            coefficients as u32,
            offset as u32,
        );
    }

    /// The views in parts whose buffers all fit, culled one after the other.
    pub(super) fn culled(&self) -> impl Iterator<Item = Culled> {
        let faces = self.op.faces.len();
        let largest = (4 * self.stride() * faces).max(4 * self.cells_per_view() * words(self.op));
        // A launch counts at most 65535 cubes along an axis.
        let step = (BUFFER / largest).clamp(1, 65535);
        (0..self.views).step_by(step).map(move |first| {
            let views = step.min(self.views - first);
            self.cull(first, views)
        })
    }

    fn cull(&self, first_view: usize, views: usize) -> Culled {
        let faces = self.op.faces.len();
        let jobs = views * faces;
        let corners = self.buffer(self.stride() * jobs, DType::F32);
        let reaches = self.buffer(4 * jobs + views, DType::U32);
        prepare::launch(
            &self.client,
            self.cubes(jobs, CUBE),
            CubeDim::new_1d(CUBE),
            self.vertices.clone().into_array_arg(),
            self.direction().into_array_arg(),
            self.topology.faces.clone().into_array_arg(),
            corners.clone().into_array_arg(),
            reaches.clone().into_array_arg(),
            self.frame(),
            first_view as u32,
            self.vertex_count as u32,
            faces as u32,
            jobs as u32,
            (self.op.near as f32).to_bits(),
            self.far.to_bits(),
            self.op.grid.outer as f32,
            self.depths,
            self.second(),
        );
        count_drawn::launch(
            &self.client,
            CubeCount::Static(views as u32, 1, 1),
            CubeDim::new_1d(CUBE),
            reaches.clone().into_array_arg(),
            faces as u32,
            CUBE,
        );
        let words = views * self.cells_per_view() * words(self.op);
        let cells = self.buffer(words, DType::U32);
        fill_cells::launch(
            &self.client,
            self.cubes(words, CUBE),
            CubeDim::new_1d(CUBE),
            reaches.clone().into_array_arg(),
            cells.clone().into_array_arg(),
            faces as u32,
            self::words(self.op) as u32,
            self.per_row() as u32,
            self.per_column() as u32,
            self.side as u32,
            words as u32,
        );
        Culled { first_view, views, corners, reaches, cells }
    }

    /// Writes the sums of the views to `out`, all views being at `offset`.
    fn write_sums(&self, culled: &Culled, out: &Buffer, offset: usize) {
        let ImageSize { height, width } = self.op.size;
        let [across, down] = [width, height].map(|side| side.div_ceil(TILE as usize) as u32);
        sum_pixels::launch(
            &self.client,
            CubeCount::Static(across, down, culled.views as u32),
            CubeDim::new_2d(TILE, TILE),
            culled.corners.clone().into_array_arg(),
            culled.reaches.clone().into_array_arg(),
            culled.cells.clone().into_array_arg(),
            self.table.clone().into_array_arg(),
            self.direction().into_array_arg(),
            out.clone().into_array_arg(),
            self.cells(culled),
            self.lookup(),
            self.frame(),
            self.table_offset(),
            culled.first_view as u32,
            offset as u32,
            self.second(),
        );
    }

    /// Writes the gradient to the vertices of the views to the start of `out`.
    fn write_corners(&self, culled: &Culled, upstream: &Buffer, out: &Buffer) {
        let faces = self.op.faces.len();
        let jobs = culled.views * faces;
        let of_faces = self.buffer(6 * jobs, DType::F32);
        sum_faces::launch(
            &self.client,
            self.cubes(jobs * UNITS as usize, UNITS),
            CubeDim::new_1d(UNITS),
            culled.corners.clone().into_array_arg(),
            culled.reaches.clone().into_array_arg(),
            self.table.clone().into_array_arg(),
            self.direction().into_array_arg(),
            upstream.clone().into_array_arg(),
            of_faces.clone().into_array_arg(),
            self.lookup(),
            self.frame(),
            faces as u32,
            jobs as u32,
            self.table_offset(),
            culled.first_view as u32,
            self.second(),
        );
        let jobs = culled.views * self.vertex_count;
        sum_vertices::launch(
            &self.client,
            self.cubes(jobs, CUBE),
            CubeDim::new_1d(CUBE),
            of_faces.into_array_arg(),
            self.topology.corners.clone().into_array_arg(),
            out.clone().into_array_arg(),
            self.vertex_count as u32,
            faces as u32,
            jobs as u32,
            culled.first_view as u32,
        );
    }

    /// Adds the gradient to the table of the culled views to `partial`.
    fn add_cubics(&self, culled: &Culled, upstream: &Buffer, partial: &Partial) {
        sum_cubics::launch(
            &self.client,
            CubeCount::Static(partial.cubes as u32, 1, 1),
            CubeDim::new_2d(TILE, TILE),
            culled.corners.clone().into_array_arg(),
            culled.reaches.clone().into_array_arg(),
            culled.cells.clone().into_array_arg(),
            upstream.clone().into_array_arg(),
            partial.tables.clone().into_array_arg(),
            self.cells(culled),
            self.lookup(),
            self.frame(),
            culled.first_view as u32,
            self.second(),
        );
    }

    /// What stands for tables.
    pub(super) fn table(&self) -> &Buffer {
        &self.table
    }

    pub(super) fn second(&self) -> bool {
        self.direction.is_some()
    }

    /// The direction; any buffer where there is none, as nothing then reads it.
    pub(super) fn direction(&self) -> Buffer {
        self.direction.as_ref().unwrap_or(&self.table).clone()
    }

    /// Where the table starts in the direction.
    fn table_offset(&self) -> u32 {
        if self.second() { (3 * self.views * self.vertex_count) as u32 } else { 0 }
    }

    /// Numbers that describe a face.
    fn stride(&self) -> usize {
        let numbers = if self.depths { 9 } else { 6 };
        if self.second() { 2 * numbers } else { numbers }
    }

    pub(super) fn pixels(&self) -> usize {
        self.views * self.op.size.pixels()
    }

    fn rows(&self) -> usize {
        self.op.grid.rows()
    }

    /// Cells in a row of the image.
    fn per_row(&self) -> usize {
        self.op.size.width.div_ceil(self.side)
    }

    /// Cells in a column of the image.
    fn per_column(&self) -> usize {
        self.op.size.height.div_ceil(self.side)
    }

    fn cells_per_view(&self) -> usize {
        self.per_row() * self.per_column()
    }

    pub(super) fn frame(&self) -> FrameLaunch<WgpuRuntime> {
        let ImageSize { height, width } = self.op.size;
        FrameLaunch::new(height as u32, width as u32, height.min(width) as u32)
    }

    pub(super) fn cells(&self, culled: &Culled) -> CellsLaunch<WgpuRuntime> {
        CellsLaunch::new(
            self.side as u32,
            self.per_row() as u32,
            self.per_column() as u32,
            words(self.op) as u32,
            self.op.faces.len() as u32,
            culled.views as u32,
        )
    }

    fn lookup(&self) -> LookupLaunch<WgpuRuntime> {
        lookup(&self.op.grid)
    }

    pub(super) fn cubes(&self, jobs: usize, units: u32) -> CubeCount {
        calculate_cube_count_elemwise(&self.client, jobs, CubeDim::new_1d(units))
    }

    /// A flat buffer that nothing has been written to.
    pub(super) fn buffer(&self, length: usize, dtype: DType) -> Buffer {
        let handle = self.client.empty(length * dtype.size());
        let device = self.vertices.device.clone();
        CubeTensor::new_contiguous(self.client.clone(), device, [length].into(), handle, dtype)
    }

    pub(super) fn zeros(&self, length: usize, dtype: DType) -> Buffer {
        let device = self.vertices.device.clone();
        zeros_client(self.client.clone(), device, [length].into(), dtype)
    }
}

/// A grid prepared for look-ups.
pub(super) fn lookup(grid: &Grid) -> LookupLaunch<WgpuRuntime> {
    let [start, end] = [grid.octaves, grid.far + 1].map(|k| f64::exp2(-f64::from(k)));
    let [outer, inner] = grid.lookups(1.0).map(|side| side.map(|number| number as f32));
    LookupLaunch::new(
        outer[0],
        inner[0],
        outer[1],
        inner[1],
        start as f32,
        grid.octaves,
        grid.bits,
        grid.far,
        (1.0 - 2.0 * end) as f32,
        end as f32,
        grid.cells() as u32,
    )
}

/// Words that hold a bit for each face.
fn words(op: &ProfileSum) -> usize {
    op.faces.len().div_ceil(32)
}
