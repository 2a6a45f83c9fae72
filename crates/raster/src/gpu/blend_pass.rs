//! One call of the op of colours: which kernels run over which buffers.

use burn::{
    backend::wgpu::WgpuRuntime,
    tensor::{DType, Slice, TensorMetadata, ops::FloatTensorOps},
};
use burn_cubecl::{cubecl::prelude::*, kernel::into_contiguous};

use super::{
    TILE, Wgpu,
    blend::{OF_PIXEL, blend_faces, blend_pixels, gather_corners},
    gradient::UNITS,
    pass::{Buffer, CUBE, Culled, Pass, lookup},
    shown::{Kind, WeightsLaunch},
    topology::{OnDevice, Topology},
};
use crate::{
    ImageSize, ProfileSum, SoftBlend,
    kernel::{
        Grid,
        blend::{DepthGrid, LEAST},
    },
    weighting::{FARTHEST_SEEN, counts_from},
};

/// Stands for no limit.
const LOWEST: f32 = -1e30;

/// Inputs of a pass: vertices, attributes, tables and background, and in a pass of second order their derivatives.
pub(super) struct Inputs {
    pub(super) vertices: Buffer,
    pub(super) attributes: Buffer,
    pub(super) tables: Buffer,
    pub(super) background: Buffer,
    pub(super) along: Option<[Buffer; 4]>,
}

/// Inputs on the device.
pub(super) struct Blend<'a> {
    op: &'a SoftBlend,
    pass: Pass<'a>,
    /// Tables, attributes and background.
    numbers: Buffer,
    direction: Option<Buffer>,
    /// Entries of the attributes at the corners of faces, and the corners of each entry.
    entries: OnDevice,
    entry_count: usize,
    channels: usize,
    /// Whether all views have the same attributes.
    shared: bool,
    /// Where attributes and background begin in the numbers.
    starts: [usize; 2],
}

/// What of the silhouettes' op culls the faces of this one: an edge softness reaches as far as its table.
pub(super) fn culling(op: &SoftBlend) -> ProfileSum {
    ProfileSum {
        faces: op.faces.clone(),
        grid: Grid { outer: op.edge.inner, ..op.edge },
        size: op.size,
        near: crate::NEAR,
        kept: None,
        topology: op.topology.clone(),
    }
}

impl<'a> Blend<'a> {
    pub(super) fn new(op: &'a SoftBlend, culling: &'a ProfileSum, inputs: Inputs) -> Self {
        let Inputs { vertices, attributes, tables, background, along } = inputs;
        let (views, entry_count) = (attributes.shape()[0], attributes.shape()[1]);
        let channels = background.shape().num_elements() - 1;
        let flat = |tensor: Buffer| {
            let length = tensor.shape().num_elements();
            Wgpu::float_reshape(tensor, [length].into())
        };
        let joined = |parts: Vec<Buffer>| Wgpu::float_cat(parts.into_iter().map(flat).collect(), 0);
        let starts = [
            tables.shape().num_elements(),
            tables.shape().num_elements() + attributes.shape().num_elements(),
        ];
        let numbers = joined(vec![tables, attributes, background]);
        let direction = along.map(|[vertices, attributes, tables, background]| {
            into_contiguous(joined(vec![vertices, tables, attributes, background]))
        });
        let pass = Pass::new(culling, vertices, numbers, direction.clone());
        let pass = pass.with_depths(FARTHEST_SEEN as f32);
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
    pub(super) fn image(&self) -> Buffer {
        let image = self.pass.buffer(self.image_length(), DType::F32);
        let unused = self.pass.buffer(1, DType::F32);
        for culled in self.pass.culled() {
            self.write_pixels(&culled, &self.numbers, &unused, &image, false);
        }
        image
    }

    /// Gradients of `Σ upstream · image` to vertices, attributes and background, flat; in a pass of second order their derivatives, and that
    /// of the image.
    pub(super) fn gradient(&self, upstream: Buffer) -> [Buffer; 4] {
        let upstream = into_contiguous(upstream);
        let (views, channels) = (self.pass.views, self.channels);
        let of_pixel = OF_PIXEL + channels + 1;
        let buffer = |length: usize| self.pass.buffer(length, DType::F32);
        let pixels = buffer(self.pass.pixels() * of_pixel);
        let image = buffer(if self.pass.second() { self.image_length() } else { 1 });
        let vertices = buffer(3 * views * self.pass.vertex_count);
        let attributes = buffer(channels * views * self.entry_count);
        for culled in self.pass.culled() {
            self.write_pixels(&culled, &upstream, &pixels, &image, true);
            let of_faces = self.write_faces(&culled, &upstream, &pixels);
            let corners = &self.pass.topology.corners;
            let counts = [self.pass.vertex_count, 0, 3];
            self.gather(&culled, &of_faces, corners, &vertices, counts, false);
            let counts = [self.entry_count, 9, channels];
            self.gather(&culled, &of_faces, &self.entries.corners, &attributes, counts, true);
        }
        let behind = Wgpu::float_reshape(pixels, [self.pass.pixels(), of_pixel].into());
        let all = Slice::from(0..self.pass.pixels());
        let behind = Wgpu::float_slice(behind, &[all, Slice::from(OF_PIXEL..of_pixel)]);
        let behind = Wgpu::float_reshape(Wgpu::float_sum_dim(behind, 0), [channels + 1].into());
        let entries = channels * self.entry_count;
        let attributes = match self.shared {
            true => {
                let by_view = Wgpu::float_reshape(attributes, [views, entries].into());
                Wgpu::float_reshape(Wgpu::float_sum_dim(by_view, 0), [entries].into())
            }
            false => attributes,
        };
        [vertices, attributes, behind, image]
    }

    /// Numbers of the image of all views.
    fn image_length(&self) -> usize {
        self.pass.pixels() * (self.channels + 1)
    }

    fn write_pixels(
        &self,
        culled: &Culled,
        upstream: &Buffer,
        pixels: &Buffer,
        image: &Buffer,
        pull: bool,
    ) {
        let ImageSize { height, width } = self.op.size;
        let [across, down] = [width, height].map(|side| side.div_ceil(TILE as usize) as u32);
        blend_pixels::launch(
            &self.pass.client,
            CubeCount::Static(across, down, culled.views as u32),
            CubeDim::new_2d(TILE, TILE),
            culled.corners.clone().into_array_arg(),
            culled.reaches.clone().into_array_arg(),
            culled.cells.clone().into_array_arg(),
            self.numbers.clone().into_array_arg(),
            self.direction().into_array_arg(),
            self.entries.faces.clone().into_array_arg(),
            upstream.clone().into_array_arg(),
            pixels.clone().into_array_arg(),
            image.clone().into_array_arg(),
            self.pass.cells(culled),
            self.weights(),
            self.pass.frame(),
            culled.first_view as u32,
            self.kind(),
            pull,
        );
    }

    fn write_faces(&self, culled: &Culled, upstream: &Buffer, pixels: &Buffer) -> Buffer {
        let jobs = culled.views * self.op.faces.len();
        let of_faces = self.pass.buffer(self.of_face() * jobs, DType::F32);
        blend_faces::launch(
            &self.pass.client,
            self.pass.cubes(jobs * UNITS as usize, UNITS),
            CubeDim::new_1d(UNITS),
            culled.corners.clone().into_array_arg(),
            culled.reaches.clone().into_array_arg(),
            self.numbers.clone().into_array_arg(),
            self.direction().into_array_arg(),
            self.entries.faces.clone().into_array_arg(),
            upstream.clone().into_array_arg(),
            pixels.clone().into_array_arg(),
            of_faces.clone().into_array_arg(),
            self.weights(),
            self.pass.frame(),
            self.op.faces.len() as u32,
            jobs as u32,
            culled.first_view as u32,
            self.kind(),
        );
        of_faces
    }

    /// Adds up the corners of each of `count` vertices or entries: `of_each` numbers, which stand from `first` on in those of a face.
    fn gather(
        &self,
        culled: &Culled,
        of_faces: &Buffer,
        corners: &Buffer,
        gradient: &Buffer,
        [count, first, of_each]: [usize; 3],
        by_vertex: bool,
    ) {
        let jobs = culled.views * count * of_each;
        gather_corners::launch(
            &self.pass.client,
            self.pass.cubes(jobs, CUBE),
            CubeDim::new_1d(CUBE),
            of_faces.clone().into_array_arg(),
            corners.clone().into_array_arg(),
            gradient.clone().into_array_arg(),
            count as u32,
            self.op.faces.len() as u32,
            jobs as u32,
            culled.first_view as u32,
            self.of_face() as u32,
            first as u32,
            of_each as u32,
            by_vertex,
        );
    }

    /// Numbers of a face in a gradient.
    fn of_face(&self) -> usize {
        9 + 3 * self.channels
    }

    /// The direction; any buffer where there is none, as nothing then reads it.
    fn direction(&self) -> Buffer {
        self.direction.as_ref().unwrap_or(&self.numbers).clone()
    }

    fn kind(&self) -> Kind {
        let far_depth = matches!(self.op.depth, DepthGrid::Table(grid) if grid.far > 0);
        Kind {
            far_edge: self.op.edge.far > 0,
            far_depth,
            is_line: matches!(self.op.depth, DepthGrid::Line { .. }),
            is_exponential: self.op.depth == DepthGrid::Exponential,
            channels: self.channels,
            second: self.pass.second(),
        }
    }

    fn weights(&self) -> WeightsLaunch<WgpuRuntime> {
        let op = self.op;
        let (depth, least) = match op.depth {
            DepthGrid::Table(grid) => (grid, 0.0),
            DepthGrid::Exponential => (op.edge, LEAST),
            DepthGrid::Line { floor } => (op.edge, floor),
        };
        let [near, far] = op.planes;
        let along =
            if self.pass.second() { 3 * self.pass.views * self.pass.vertex_count } else { 0 };
        WeightsLaunch::new(
            lookup(&op.edge, 0),
            lookup(&depth, 0),
            op.edge.rows() as u32,
            self.starts[0] as u32,
            self.starts[1] as u32,
            if self.shared { 0 } else { (self.channels * self.entry_count) as u32 },
            along as u32,
            near as f32,
            (far - near).recip() as f32,
            op.floor as f32,
            (counts_from(op.floor) as f32).max(LOWEST),
            least as f32,
        )
    }
}
