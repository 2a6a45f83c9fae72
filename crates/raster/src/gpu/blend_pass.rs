//! One call of the colour op: the launches of its kernels and their buffers.

use softrast_kernel::{
    Grid,
    blend::{DepthGrid, LEAST, counts_from},
};
use softrast_tensor::{
    DType, FloatTensorOps, Slice, TensorMetadata,
    gpu::{CubeRuntime, cubecl::prelude::*, into_contiguous},
};

use super::{
    backend::Floats,
    blend::{
        self, AddedLaunch, add_shares, blend_cubics, blend_faces, find_largest, finish_pixels,
        sum_background, summed,
    },
    blend_inputs::{BlendInputsLaunch, BlendParamsLaunch, BlendSpec},
    of_pixel::OF_PIXEL,
    parts::SLOTS,
    pass::{CUBE, Partial, Pass, lookup},
    prepared::{Buffer, Prepared, SumOnGpu},
    table::{self, sum_tables},
    texels::{MEASURED, sum_texels, texel_floats},
    topology::{OnDevice, Topology},
    whole::MARKS,
};
use crate::{ProfileSum, SoftBlend};

/// Logarithm for no limit.
const LOWEST: f32 = -1e30;

/// Inputs on the device.
pub(super) struct Blend<'a, R: CubeRuntime> {
    op: &'a SoftBlend,
    pass: Pass<'a, R>,
    /// Tables, attributes, background and texture.
    numbers: Buffer<R>,
    direction: Option<Buffer<R>>,
    /// Entries of the attributes at the corners of faces, and the corners of each entry.
    entries: OnDevice<R>,
    entry_count: usize,
    channels: usize,
    /// Whether all views share the attributes.
    shared: bool,
    /// Start of attributes, background and texture in the numbers.
    starts: [usize; 3],
}

/// Accumulator of a gradient of texels.
struct Texels<R: CubeRuntime> {
    /// The measured words, then two words for each of `count` numbers.
    sums: Buffer<R>,
    count: usize,
}

/// Results of a backward pass.
pub(super) struct Gradient<R: CubeRuntime> {
    pub(super) vertices: Buffer<R>,
    pub(super) attributes: Buffer<R>,
    pub(super) tables: Option<Buffer<R>>,
    pub(super) background: Buffer<R>,
    pub(super) texture: Option<Buffer<R>>,
    /// The derivative of the image, in a pass of second order.
    pub(super) image: Buffer<R>,
}

/// A `ProfileSum` that only provides the support of faces for the colour op: that of the edge table.
pub(super) fn as_sum(op: &SoftBlend) -> ProfileSum {
    ProfileSum {
        culls: op.culls,
        faces: op.faces.clone(),
        grid: Grid { outer: op.edge.inner, from: [op.edge.from[1]; 2], ..op.edge },
        size: op.size,
        near: crate::NEAR,
        kept: None,
        on_gpu: SumOnGpu { topology: op.topology.clone(), ..SumOnGpu::new(false) },
    }
}

impl<'a, R: CubeRuntime> Blend<'a, R> {
    /// `inputs` are vertices, attributes, tables, background and, if there is one, the texture; `direction` their derivatives, flat, in a pass
    /// of second order.
    pub(super) fn new(
        op: &'a SoftBlend,
        sum: &'a ProfileSum,
        inputs: Vec<Buffer<R>>,
        direction: Option<Buffer<R>>,
    ) -> Self {
        let lengths: Vec<usize> = inputs.iter().map(|input| input.shape().num_elements()).collect();
        let (views, entry_count) = (inputs[1].shape()[0], inputs[1].shape()[1]);
        let channels = lengths[3] - 1;
        let flat = |tensor: Buffer<R>| {
            let length = tensor.shape().num_elements();
            Floats::<R>::float_reshape(tensor, [length].into())
        };
        let starts = [lengths[2], lengths[2] + lengths[1], lengths[2] + lengths[1] + lengths[3]];
        let mut inputs = inputs.into_iter();
        let vertices = inputs.next().expect("vertices");
        // The tables come first.
        let mut numbers: Vec<Buffer<R>> = inputs.map(flat).collect();
        numbers.swap(0, 1);
        let numbers = Floats::<R>::float_cat(numbers, 0);
        let direction = direction.map(|direction| {
            let mut start = 0;
            let mut parts: Vec<Buffer<R>> = lengths
                .iter()
                .map(|length| {
                    start += length;
                    Floats::<R>::float_slice(
                        direction.clone(),
                        &[Slice::from(start - length..start)],
                    )
                })
                .collect();
            parts.swap(1, 2);
            into_contiguous(Floats::<R>::float_cat(parts, 0))
        });
        let pass = Pass::new(sum, vertices, numbers, direction.clone());
        let numbers_of_entry = if op.texture.is_some() { 2 } else { channels };
        let numbers_of_pixel = if direction.is_some() { 2 } else { 1 } * (channels + 1);
        let pass = pass.with_depths([numbers_of_pixel, 9 + 3 * numbers_of_entry]);
        let device = pass.vertices.device.clone();
        let same = entry_count == pass.vertex_count && op.entries == op.faces;
        let entries = match same {
            true => pass.topology.clone(),
            false => Topology::default().on(&op.entries, entry_count, &pass.client, &device),
        };
        let numbers = pass.table().clone();
        let shared = views == 1;
        Self { op, pass, numbers, direction, entries, entry_count, channels, shared, starts }
    }

    /// The image, flat.
    pub(super) fn image(&self) -> Buffer<R> {
        let image = self.pass.buffer(self.image_length(), DType::F32);
        let unused = self.pass.buffer(1, DType::F32);
        for faces in self.pass.prepared() {
            self.write_pixels(&faces, &self.numbers, &unused, &image, false);
        }
        image
    }

    /// Gradients of `Σ upstream · image` with respect to vertices, attributes, tables, background and texture, flat; in a pass of second
    /// order their derivatives, and that of the image. Tables and texture are included if they are wanted.
    pub(super) fn gradient(
        &self,
        upstream: Buffer<R>,
        of_tables: bool,
        of_texels: bool,
    ) -> Gradient<R> {
        let upstream = into_contiguous(upstream);
        let (views, channels) = (self.pass.views, self.channels);
        let numbers = self.kind().numbers();
        let of_pixel = OF_PIXEL + channels + 1;
        let buffer = |length: usize| self.pass.buffer(length, DType::F32);
        let pixels = buffer(self.pass.pixels() * of_pixel);
        let image = buffer(if self.pass.second() { self.image_length() } else { 1 });
        let vertices = buffer(3 * views * self.pass.vertex_count);
        let attributes = buffer(numbers * views * self.entry_count);
        let rows = self.op.edge.rows() + self.op.depth.rows();
        let partial = of_tables.then(|| self.pass.partial(rows));
        let texels = of_texels.then(|| self.no_texels());
        let stride = self.of_face();
        for faces in self.pass.prepared() {
            self.write_pixels(&faces, &upstream, &pixels, &image, true);
            let of_faces = self.write_faces(&faces, &upstream, &pixels);
            let corners = (&self.pass.topology.corners, self.pass.vertex_count);
            self.pass.gather(&faces, &of_faces, corners, &vertices, [stride, 0, 3, 3], false);
            let corners = (&self.entries.corners, self.entry_count);
            let entries = [stride, 9, numbers, numbers];
            self.pass.gather(&faces, &of_faces, corners, &attributes, entries, true);
            if let Some(partial) = &partial {
                self.add_cubics(&faces, &upstream, &pixels, partial, rows);
            }
            if let Some(texels) = &texels {
                self.add_texels(&faces, &upstream, &pixels, texels, true);
            }
        }
        if let Some(texels) = &texels {
            for faces in self.pass.prepared() {
                self.add_texels(&faces, &upstream, &pixels, texels, false);
            }
        }
        let tables = partial.map(|partial| {
            let tables = buffer(4 * rows);
            self.pass.add_up(partial, &tables, 0);
            tables
        });
        let texture = texels.map(|texels| self.floats(texels));
        let entries = numbers * self.entry_count;
        let attributes = match self.shared {
            true => {
                let by_view = Floats::<R>::float_reshape(attributes, [views, entries].into());
                Floats::<R>::float_reshape(Floats::<R>::float_sum_dim(by_view, 0), [entries].into())
            }
            false => attributes,
        };
        let background = self.background(pixels);
        Gradient { vertices, attributes, tables, background, texture, image }
    }

    /// The gradient of the background, summed over all pixels.
    fn background(&self, pixels: Buffer<R>) -> Buffer<R> {
        let (count, numbers) = (self.pass.pixels(), self.channels + 1);
        let cubes = count.div_ceil(16 * table::UNITS as usize).clamp(1, 256);
        let [partial, out] = [cubes * numbers, numbers].map(|n| self.pass.buffer(n, DType::F32));
        sum_background::launch(
            &self.pass.client,
            CubeCount::Static(cubes as u32, 1, 1),
            CubeDim::new_1d(table::UNITS),
            pixels.into_array_arg(),
            partial.clone().into_array_arg(),
            count as u32,
            self.kind(),
        );
        sum_tables::launch(
            &self.pass.client,
            self.pass.cubes(numbers, CUBE),
            CubeDim::new_1d(CUBE),
            partial.into_array_arg(),
            out.clone().into_array_arg(),
            cubes as u32,
            numbers as u32,
            0,
        );
        out
    }

    /// Length of the image of all views.
    fn image_length(&self) -> usize {
        self.pass.pixels() * (self.channels + 1)
    }

    /// Draws some views: writes to `image`, and with `pull` the intermediates of gradients to `pixels`.
    fn write_pixels(
        &self,
        faces: &Prepared<R>,
        upstream: &Buffer<R>,
        pixels: &Buffer<R>,
        image: &Buffer<R>,
        pull: bool,
    ) {
        let (client, kind) = (&self.pass.client, self.kind());
        let plane = self.op.size.pixels();
        let count = faces.views * plane;
        let marks = self.pass.buffer(MARKS as usize * count, DType::U32);
        let sums = self.pass.buffer(2 * summed(kind) * count, DType::U32);
        let unused = self.pass.buffer(1, DType::U32);
        self.pass.zero([
            (&unused, 0),
            (&marks, MARKS as usize * count),
            (&sums, 2 * summed(kind) * count),
        ]);
        let (cubes, cube) = (self.parts(faces), CubeDim::new_1d(blend::UNITS));
        let (drawn, written) = (self.drawn(faces), marks.clone().into_array_arg());
        find_largest::launch(client, cubes.clone(), cube, drawn, written, kind);
        for measure in [true, false] {
            add_shares::launch(
                client,
                cubes.clone(),
                cube,
                self.drawn(faces),
                marks.clone().into_array_arg(),
                sums.clone().into_array_arg(),
                kind,
                measure,
            );
        }
        let added = AddedLaunch::new(
            marks.into_array_arg(),
            sums.into_array_arg(),
            self.starts[1] as u32,
            self.along() as u32,
            self.op.faces.len() as u32,
            faces.first_view as u32,
            plane as u32,
            count as u32,
        );
        finish_pixels::launch(
            client,
            self.pass.cubes(count, CUBE),
            CubeDim::new_1d(CUBE),
            added,
            self.numbers.clone().into_array_arg(),
            self.direction().into_array_arg(),
            upstream.clone().into_array_arg(),
            pixels.clone().into_array_arg(),
            image.clone().into_array_arg(),
            kind,
            pull,
        );
    }

    fn write_faces(
        &self,
        faces: &Prepared<R>,
        upstream: &Buffer<R>,
        pixels: &Buffer<R>,
    ) -> Buffer<R> {
        let groups = faces.views * self.op.faces.len() + SLOTS as usize;
        let of_faces = self.pass.buffer(self.of_face() * groups, DType::F32);
        blend_faces::launch(
            &self.pass.client,
            self.parts(faces),
            CubeDim::new_1d(blend::UNITS),
            self.drawn(faces),
            upstream.clone().into_array_arg(),
            pixels.clone().into_array_arg(),
            of_faces.clone().into_array_arg(),
            self.kind(),
        );
        of_faces
    }

    /// Adds the gradient of both tables, of `rows` rows in total, to `partial`.
    fn add_cubics(
        &self,
        faces: &Prepared<R>,
        upstream: &Buffer<R>,
        pixels: &Buffer<R>,
        partial: &Partial<R>,
        rows: usize,
    ) {
        blend_cubics::launch(
            &self.pass.client,
            CubeCount::Static(partial.cubes as u32, 1, 1),
            CubeDim::new_1d(table::UNITS),
            self.drawn(faces),
            upstream.clone().into_array_arg(),
            pixels.clone().into_array_arg(),
            partial.tables.clone().into_array_arg(),
            rows as u32,
            self.kind(),
        );
    }

    /// A zero gradient of the texture.
    fn no_texels(&self) -> Texels<R> {
        let count = self.numbers.shape().num_elements() - self.starts[2];
        Texels { sums: self.pass.zeros(MEASURED + 2 * count, DType::U32), count }
    }

    /// With `measure` computes the largest magnitude of a term, else sums all terms.
    fn add_texels(
        &self,
        faces: &Prepared<R>,
        upstream: &Buffer<R>,
        pixels: &Buffer<R>,
        texels: &Texels<R>,
        measure: bool,
    ) {
        sum_texels::launch(
            &self.pass.client,
            self.parts(faces),
            CubeDim::new_1d(blend::UNITS),
            self.drawn(faces),
            upstream.clone().into_array_arg(),
            pixels.clone().into_array_arg(),
            texels.sums.clone().into_array_arg(),
            self.kind(),
            measure,
        );
    }

    /// The summed terms, as floats.
    fn floats(&self, texels: Texels<R>) -> Buffer<R> {
        let gradient = self.pass.buffer(texels.count, DType::F32);
        texel_floats::launch(
            &self.pass.client,
            self.pass.cubes(texels.count, CUBE),
            CubeDim::new_1d(CUBE),
            texels.sums.into_array_arg(),
            gradient.clone().into_array_arg(),
            texels.count as u32,
        );
        gradient
    }

    /// The inputs of the kernels.
    fn drawn(&self, faces: &Prepared<R>) -> BlendInputsLaunch<R> {
        BlendInputsLaunch::new(
            faces.corners.clone().into_array_arg(),
            faces.reaches.clone().into_array_arg(),
            faces.slots.clone().into_array_arg(),
            self.numbers.clone().into_array_arg(),
            self.direction().into_array_arg(),
            self.entries.faces.clone().into_array_arg(),
            self.weights(),
            self.pass.frame(),
            self.op.faces.len() as u32,
            faces.first_view as u32,
            faces.views as u32,
        )
    }

    /// One cube per part of a face.
    fn parts(&self, faces: &Prepared<R>) -> CubeCount {
        let groups = faces.views * self.op.faces.len() + SLOTS as usize;
        self.pass.cubes(groups * blend::UNITS as usize, blend::UNITS)
    }

    /// Numbers per face in a gradient.
    fn of_face(&self) -> usize {
        9 + 3 * self.kind().numbers()
    }

    /// The direction; without one any buffer, since it is not read.
    fn direction(&self) -> Buffer<R> {
        self.direction.as_ref().unwrap_or(&self.numbers).clone()
    }

    /// Start of the derivatives of the numbers in the direction.
    fn along(&self) -> usize {
        if self.pass.second() { 3 * self.pass.views * self.pass.vertex_count } else { 0 }
    }

    fn kind(&self) -> BlendSpec {
        let far_depth = matches!(self.op.depth, DepthGrid::Table(grid) if grid.far > 0);
        BlendSpec {
            far_edge: self.op.edge.far > 0,
            far_depth,
            is_line: matches!(self.op.depth, DepthGrid::Line { .. }),
            is_exponential: self.op.depth == DepthGrid::Exponential,
            is_textured: self.op.texture.is_some(),
            channels: self.channels,
            second: self.pass.second(),
        }
    }

    fn weights(&self) -> BlendParamsLaunch<R> {
        let op = self.op;
        let (depth, least) = match op.depth {
            DepthGrid::Table(grid) => (grid, 0.0),
            DepthGrid::Exponential => (op.edge, LEAST),
            DepthGrid::Line { floor } => (op.edge, floor),
        };
        let [near, far] = op.planes;
        let [rows, columns] = op.texture.unwrap_or([1, 1]);
        BlendParamsLaunch::new(
            lookup(&op.edge),
            lookup(&depth),
            op.edge.rows() as u32,
            self.starts[0] as u32,
            self.starts[1] as u32,
            self.starts[2] as u32,
            rows as u32,
            columns as u32,
            if self.shared { 0 } else { (self.kind().numbers() * self.entry_count) as u32 },
            self.along() as u32,
            near as f32,
            (far - near).recip() as f32,
            op.floor as f32,
            (counts_from(op.floor) as f32).max(LOWEST),
            least as f32,
        )
    }
}
