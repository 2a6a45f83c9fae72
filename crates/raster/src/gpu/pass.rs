//! One call of the op: the launches of its kernels and their buffers.

use softrast_kernel::Grid;
use softrast_tensor::{
    DType, TensorMetadata,
    gpu::{
        CubeRuntime, CubeTensor,
        cubecl::{calculate_cube_count_elemwise, prelude::*},
        into_contiguous, zeros_client,
    },
};

use super::{
    frame::FrameLaunch,
    gradient::{UNITS, gather_corners, sum_faces},
    kept::Kept,
    pair::LookupLaunch,
    parts::{self, SLOTS},
    prepare::{PREPARED, prepare},
    prepared::{Buffer, Prepared},
    splat::{CLEARED, Terms, clear, settle, splat},
    table::{self, sum_cubics, sum_tables},
    topology::OnDevice,
    whole::zero,
};

use crate::{ImageSize, ProfileSum, weighting::FARTHEST_SEEN};

/// Largest buffer that a pass allocates, in bytes: half of the size that every adapter can bind (128 MiB).
const BUFFER: usize = 64 << 20;
/// Pixels per face above which more units share a face.
const MANY_PIXELS: usize = 32;
/// Most faces of a launch: it has at most 65535 cubes along an axis.
const MOST_FACES: usize = 65535 * PREPARED as usize;
/// Bytes of a summed number.
const WORDS: usize = 8;
/// Size of all tables of [`sum_cubics`] together, in bytes.
const TABLES: usize = 32 << 20;
/// Units of a cube in kernels without shared memory.
pub(super) const CUBE: u32 = 64;

/// Inputs of a pass on the device.
pub(super) struct Pass<'a, R: CubeRuntime> {
    pub(super) op: &'a ProfileSum,
    pub(super) client: ComputeClient<R>,
    /// `[views, 3, vertices]`.
    pub(super) vertices: Buffer<R>,
    /// `[rows, 4]`.
    table: Buffer<R>,
    /// Derivatives of vertices and table, concatenated, in a pass of second order.
    direction: Option<Buffer<R>>,
    pub(super) topology: OnDevice<R>,
    pub(super) views: usize,
    pub(super) vertex_count: usize,
    /// Whether prepared faces include depths.
    depths: bool,
    /// Bytes per pixel of the sums.
    of_pixel: usize,
    /// Numbers per face in the gradient.
    of_face: usize,
    /// Faces beyond this depth are not drawn.
    far: f32,
}

/// Accumulators of the sums of pixels.
struct Splatted<R: CubeRuntime> {
    /// Two words per pixel.
    words: Buffer<R>,
    /// One scale for all pixels, or one per pixel.
    scale: Buffer<R>,
    terms: Terms,
}

/// Partial tables of the units that sum the gradient of a table.
pub(super) struct Partial<R: CubeRuntime> {
    pub(super) cubes: usize,
    units: usize,
    /// Numbers per table.
    coefficients: usize,
    /// `[units, rows, 4]`.
    pub(super) tables: Buffer<R>,
}

impl<'a, R: CubeRuntime> Pass<'a, R> {
    pub(super) fn new(
        op: &'a ProfileSum,
        vertices: Buffer<R>,
        table: Buffer<R>,
        direction: Option<Buffer<R>>,
    ) -> Self {
        assert_eq!(vertices.dtype(), DType::F32, "profile_sum on the GPU works in f32");
        let (client, device) = (vertices.client.clone(), vertices.device.clone());
        let (views, vertex_count) = (vertices.shape()[0], vertices.shape()[2]);
        let topology = op.on_gpu.topology.on(&op.faces, vertex_count, &client, &device);
        Self {
            op,
            client,
            vertices: into_contiguous(vertices),
            table: into_contiguous(table),
            direction: direction.map(into_contiguous),
            topology,
            views,
            vertex_count,
            depths: false,
            of_pixel: WORDS,
            of_face: 6,
            far: f32::INFINITY,
        }
    }

    /// For colours: prepared faces include depths; `of_pixel` numbers are summed per pixel, and a face has `of_face` numbers in its
    /// gradient.
    pub(super) fn with_depths(self, [of_pixel, of_face]: [usize; 2]) -> Self {
        let far = FARTHEST_SEEN as f32;
        Self { depths: true, far, of_pixel: of_pixel * WORDS, of_face, ..self }
    }

    /// Sums of the profile, flat: `[views * height * width]`.
    pub(super) fn sums(&self) -> Buffer<R> {
        let sums = self.buffer(self.pixels(), DType::F32);
        for [first, views] in self.parts() {
            let slots = self.buffer(parts::words(views, views * self.op.faces.len()), DType::U32);
            let splatted = self.cleared(views, Some(&slots));
            let faces = self.prepare(first, views, slots);
            if let Some(kept) = self.kept() {
                // Another call may have set it first, with the same faces.
                kept.get_or_set(|| faces.clone());
            }
            self.splat(&faces, splatted, &sums, 0);
        }
        sums
    }

    /// Gradient of `Σ upstream · sums` with respect to the vertices only, flat.
    pub(super) fn to_vertices(&self, upstream: Buffer<R>) -> Buffer<R> {
        let upstream = into_contiguous(upstream);
        let gradient = self.buffer(3 * self.views * self.vertex_count, DType::F32);
        for faces in self.prepared() {
            self.write_corners(&faces, &upstream, &gradient);
        }
        gradient
    }

    /// Gradient of `Σ upstream · sums` with respect to vertices and table, flat. In a pass of second order its derivative, followed by that
    /// of the sums.
    pub(super) fn gradient(&self, upstream: Buffer<R>) -> Buffer<R> {
        let upstream = into_contiguous(upstream);
        let coordinates = 3 * self.views * self.vertex_count;
        let coefficients = 4 * self.rows();
        let sums = if self.second() { self.pixels() } else { 0 };
        let gradient = self.buffer(coordinates + coefficients + sums, DType::F32);
        let partial = self.partial(self.rows());
        for faces in self.prepared() {
            self.write_corners(&faces, &upstream, &gradient);
            self.add_cubics(&faces, &upstream, &partial);
            if self.second() {
                let splatted = self.cleared(faces.views, None);
                self.splat(&faces, splatted, &gradient, coordinates + coefficients);
            }
        }
        self.add_up(partial, &gradient, coordinates);
        gradient
    }

    /// Tables of `rows` rows for units that walk over parts of faces.
    pub(super) fn partial(&self, rows: usize) -> Partial<R> {
        let (cube, coefficients) = (table::UNITS as usize, 4 * rows);
        let cubes = (TABLES / (4 * coefficients * cube)).clamp(1, 4096);
        let units = cubes * cube;
        let tables = self.zeros(units * coefficients, DType::F32);
        Partial { cubes, units, coefficients, tables }
    }

    /// Sums the tables of all units into `gradient`, from `offset` on.
    pub(super) fn add_up(&self, partial: Partial<R>, gradient: &Buffer<R>, offset: usize) {
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

    /// The faces of the views, prepared in batches of views whose buffers fit.
    pub(super) fn prepared(&self) -> impl Iterator<Item = Prepared<R>> {
        let faces = self.op.faces.len();
        self.parts().map(move |[first, views]| {
            if let Some(kept) = self.kept().and_then(Kept::get::<Prepared<R>>) {
                return kept.clone();
            }
            let slots = self.zeros(parts::words(views, views * faces), DType::U32);
            self.prepare(first, views, slots)
        })
    }

    /// First view and number of views of each batch.
    fn parts(&self) -> impl Iterator<Item = [usize; 2]> {
        let of_faces = 4 * self.stride().max(self.of_face) * self.op.faces.len();
        let of_view = of_faces.max(self.of_pixel * self.op.size.pixels());
        // A launch counts at most 65535 cubes along an axis.
        let step = (BUFFER / of_view.max(1)).clamp(1, 65535);
        let views = self.views;
        (0..views).step_by(step).map(move |first| [first, step.min(views - first)])
    }

    /// The cache of prepared faces for later passes, if the batch holds all views and nothing specific to this pass.
    fn kept(&self) -> Option<&Kept> {
        let whole = self.parts().count() == 1 && !self.second() && !self.depths;
        self.op.on_gpu.kept.as_ref().filter(|_| whole)
    }

    /// Prepares the faces of some views. The first words of `slots` are 0.
    fn prepare(&self, first_view: usize, views: usize, slots: Buffer<R>) -> Prepared<R> {
        let faces = self.op.faces.len();
        assert!(faces <= MOST_FACES, "a GPU draws at most {MOST_FACES} faces, found {faces}");
        let jobs = views * faces;
        let corners = self.buffer(self.stride() * jobs, DType::F32);
        let reaches = self.buffer(4 * jobs, DType::U32);
        prepare::launch(
            &self.client,
            CubeCount::Static(faces.div_ceil(PREPARED as usize) as u32, views as u32, 1),
            CubeDim::new_1d(PREPARED),
            self.vertices.clone().into_array_arg(),
            self.direction().into_array_arg(),
            self.topology.faces.clone().into_array_arg(),
            corners.clone().into_array_arg(),
            reaches.clone().into_array_arg(),
            slots.clone().into_array_arg(),
            self.frame(),
            first_view as u32,
            views as u32,
            self.vertex_count as u32,
            faces as u32,
            (self.op.near as f32).to_bits(),
            self.far.to_bits(),
            self.op.grid.outer as f32,
            self.depths,
            self.op.culls,
            self.second(),
        );
        Prepared { first_view, views, corners, reaches, slots }
    }

    /// Zeroed sums for the pixels of some views and zeros in the first words of `slots`; how terms are added, and their scale.
    fn cleared(&self, views: usize, slots: Option<&Buffer<R>>) -> Splatted<R> {
        let pixels = views * self.op.size.pixels();
        let words = self.buffer(2 * pixels, DType::U32);
        let header = if slots.is_some() { 1 + views } else { 0 };
        let slots = slots.cloned().unwrap_or_else(|| self.buffer(1, DType::U32));
        if self.op.on_gpu.like_depths && !self.second() {
            let scale = self.buffer(2, DType::U32);
            clear::launch(
                &self.client,
                self.cubes(2 * pixels, CLEARED),
                CubeDim::new_1d(CLEARED),
                self.table.clone().into_array_arg(),
                slots.clone().into_array_arg(),
                words.clone().into_array_arg(),
                scale.clone().into_array_arg(),
                header as u32,
                2 * pixels as u32,
                self.rows() as u32,
                self.op.faces.len() as u32,
            );
            return Splatted { words, scale, terms: Terms::Scaled };
        }
        let scale = self.buffer(pixels, DType::U32);
        self.zero([(&slots, header), (&scale, pixels), (&words, 2 * pixels)]);
        Splatted { words, scale, terms: Terms::Relative }
    }

    /// Writes zeros to the first words of three buffers.
    pub(super) fn zero(&self, buffers: [(&Buffer<R>, usize); 3]) {
        let [(a, of_a), (b, of_b), (c, of_c)] = buffers;
        zero::launch(
            &self.client,
            self.cubes(of_a.max(of_b).max(of_c), CUBE),
            CubeDim::new_1d(CUBE),
            a.clone().into_array_arg(),
            b.clone().into_array_arg(),
            c.clone().into_array_arg(),
            of_a as u32,
            of_b as u32,
            of_c as u32,
        );
    }

    /// Writes the sums of some views to `out`, where all views start at `offset`; in a pass of second order their derivatives.
    fn splat(&self, faces: &Prepared<R>, splatted: Splatted<R>, out: &Buffer<R>, offset: usize) {
        let Prepared { first_view, views, corners, reaches, slots } = faces;
        let Splatted { words, scale, terms } = splatted;
        let (face_count, lanes) = (self.op.faces.len(), self.lanes());
        let add = |terms: Terms| {
            splat::launch(
                &self.client,
                self.cubes((views * face_count + SLOTS as usize) * lanes as usize, UNITS),
                CubeDim::new_1d(UNITS),
                corners.clone().into_array_arg(),
                reaches.clone().into_array_arg(),
                slots.clone().into_array_arg(),
                self.table.clone().into_array_arg(),
                self.direction().into_array_arg(),
                scale.clone().into_array_arg(),
                words.clone().into_array_arg(),
                self.lookup(),
                self.frame(),
                face_count as u32,
                *views as u32,
                self.table_offset(),
                lanes,
                terms,
                self.second(),
            );
        };
        if terms == Terms::Relative {
            add(Terms::Measured);
        }
        add(terms);
        let pixels = self.op.size.pixels();
        settle::launch(
            &self.client,
            self.cubes(views * pixels, CUBE),
            CubeDim::new_1d(CUBE),
            words.clone().into_array_arg(),
            slots.clone().into_array_arg(),
            self.table.clone().into_array_arg(),
            self.direction().into_array_arg(),
            scale.clone().into_array_arg(),
            out.clone().into_array_arg(),
            self.lookup(),
            face_count as u32,
            pixels as u32,
            (offset + first_view * pixels) as u32,
            (views * pixels) as u32,
            self.table_offset(),
            terms,
            self.second(),
        );
    }

    /// Units that share a face, or a part of it.
    fn lanes(&self) -> u32 {
        if self.op.size.pixels() > MANY_PIXELS * self.op.faces.len() { 32 } else { 8 }
    }

    /// Writes the gradient with respect to the vertices of the views to the start of `out`.
    fn write_corners(&self, prepared: &Prepared<R>, upstream: &Buffer<R>, out: &Buffer<R>) {
        let Prepared { first_view, views, corners, reaches, slots } = prepared;
        let (faces, lanes) = (self.op.faces.len(), self.lanes());
        let groups = views * faces + SLOTS as usize;
        let of_faces = self.buffer(6 * groups, DType::F32);
        sum_faces::launch(
            &self.client,
            self.cubes(groups * lanes as usize, UNITS),
            CubeDim::new_1d(UNITS),
            corners.clone().into_array_arg(),
            reaches.clone().into_array_arg(),
            slots.clone().into_array_arg(),
            self.table.clone().into_array_arg(),
            self.direction().into_array_arg(),
            upstream.clone().into_array_arg(),
            of_faces.clone().into_array_arg(),
            self.lookup(),
            self.frame(),
            faces as u32,
            *views as u32,
            groups as u32,
            self.table_offset(),
            *first_view as u32,
            lanes,
            self.second(),
        );
        let corners = (&self.topology.corners, self.vertex_count);
        self.gather(prepared, &of_faces, corners, out, [6, 0, 2, 3], false);
    }

    /// Sums the corners of each vertex or entry: `count` numbers from `first` on in the `stride` of a face become the first of its `rows`.
    pub(super) fn gather(
        &self,
        prepared: &Prepared<R>,
        of_faces: &Buffer<R>,
        (corners, vertices): (&Buffer<R>, usize),
        gradient: &Buffer<R>,
        [stride, first, count, rows]: [usize; 4],
        by_vertex: bool,
    ) {
        gather_corners::launch(
            &self.client,
            self.cubes(prepared.views * vertices * rows, CUBE),
            CubeDim::new_1d(CUBE),
            of_faces.clone().into_array_arg(),
            corners.clone().into_array_arg(),
            prepared.reaches.clone().into_array_arg(),
            prepared.slots.clone().into_array_arg(),
            gradient.clone().into_array_arg(),
            vertices as u32,
            self.op.faces.len() as u32,
            prepared.views as u32,
            prepared.first_view as u32,
            stride as u32,
            first as u32,
            count as u32,
            rows as u32,
            by_vertex,
        );
    }

    /// Adds the gradient of the table for some views to `partial`.
    fn add_cubics(&self, faces: &Prepared<R>, upstream: &Buffer<R>, partial: &Partial<R>) {
        sum_cubics::launch(
            &self.client,
            CubeCount::Static(partial.cubes as u32, 1, 1),
            CubeDim::new_1d(table::UNITS),
            faces.corners.clone().into_array_arg(),
            faces.reaches.clone().into_array_arg(),
            faces.slots.clone().into_array_arg(),
            upstream.clone().into_array_arg(),
            partial.tables.clone().into_array_arg(),
            self.lookup(),
            self.frame(),
            self.op.faces.len() as u32,
            faces.views as u32,
            faces.first_view as u32,
            self.second(),
        );
    }

    /// The table buffer; for colours, the buffer of all shared numbers.
    pub(super) fn table(&self) -> &Buffer<R> {
        &self.table
    }

    pub(super) fn second(&self) -> bool {
        self.direction.is_some()
    }

    /// The direction; without one any buffer, since it is not read.
    pub(super) fn direction(&self) -> Buffer<R> {
        self.direction.as_ref().unwrap_or(&self.table).clone()
    }

    /// Start of the table in the direction.
    fn table_offset(&self) -> u32 {
        if self.second() { (3 * self.views * self.vertex_count) as u32 } else { 0 }
    }

    /// Numbers per prepared face.
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

    pub(super) fn frame(&self) -> FrameLaunch<R> {
        let ImageSize { height, width } = self.op.size;
        FrameLaunch::new(height as u32, width as u32, height.min(width) as u32)
    }

    fn lookup(&self) -> LookupLaunch<R> {
        lookup(&self.op.grid)
    }

    pub(super) fn cubes(&self, jobs: usize, units: u32) -> CubeCount {
        calculate_cube_count_elemwise(&self.client, jobs, CubeDim::new_1d(units))
    }

    /// An uninitialised flat buffer.
    pub(super) fn buffer(&self, length: usize, dtype: DType) -> Buffer<R> {
        let handle = self.client.empty(length * dtype.size());
        let device = self.vertices.device.clone();
        CubeTensor::new_contiguous(self.client.clone(), device, [length].into(), handle, dtype)
    }

    pub(super) fn zeros(&self, length: usize, dtype: DType) -> Buffer<R> {
        let device = self.vertices.device.clone();
        zeros_client(self.client.clone(), device, [length].into(), dtype)
    }
}

/// A grid prepared for look-ups.
pub(super) fn lookup<R: CubeRuntime>(grid: &Grid) -> LookupLaunch<R> {
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
