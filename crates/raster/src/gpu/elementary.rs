//! Passes of the small ops around the rasterizer: the launches of their kernels and their buffers.

use softrast_tensor::{
    DType, FloatTensorOps, Shape, TensorMetadata,
    gpu::{
        CubeRuntime, CubeTensor,
        cubecl::{calculate_cube_count_elemwise, prelude::*},
        into_contiguous,
    },
};

use super::{
    backend::Floats,
    camera::{self, SeenLaunch, orbit_matrices, perspective, to_matrices, to_orbits, to_points},
    flat::{length, whole_direction},
    losses::{
        self, BLOCK, ComparedLaunch, add_blocks, add_views, coverage, judge, to_image, to_sums,
    },
    pass::CUBE,
    prepared::Buffer,
};
use crate::{ElementaryOp, Pass};

/// Inputs on the device.
struct Elementary<R: CubeRuntime> {
    inputs: Vec<Buffer<R>>,
    /// Derivatives of all inputs, flat, in a pass of second order.
    direction: Option<Buffer<R>>,
}

/// Runs a pass of an op.
pub(super) fn run<R: CubeRuntime>(
    op: ElementaryOp,
    pass: &Pass,
    tensors: Vec<Buffer<R>>,
) -> Buffer<R> {
    let count = match op {
        ElementaryOp::OrbitMatrix | ElementaryOp::Coverage => 1,
        ElementaryOp::Perspective | ElementaryOp::Loss(_) => 2,
    };
    let mut inputs: Vec<Buffer<R>> = tensors.into_iter().map(into_contiguous).collect();
    let mut rest = inputs.split_off(count).into_iter();
    let lengths: Vec<usize> = inputs.iter().map(length).collect();
    let mut next = || rest.next().expect("all inputs of the pass");
    match pass {
        Pass::Forward => {
            let own = Elementary { inputs, direction: None };
            let shape = own.shape(op);
            Floats::<R>::float_reshape(own.forward(op), shape)
        }
        Pass::Vjp { wanted } => {
            let upstream = next();
            joined(Elementary { inputs, direction: None }.gradients(op, &upstream, wanted))
        }
        Pass::VjpOfVjp { along, wanted } => {
            let upstream = next();
            let direction = into_contiguous(whole_direction(next(), &lengths, along));
            let own = Elementary { inputs, direction: Some(direction) };
            let (to_upstream, wanted) = wanted.split_last().expect("one for the upstream");
            let mut parts = own.gradients(op, &upstream, wanted);
            if *to_upstream {
                parts.push(own.forward(op));
            }
            joined(parts)
        }
    }
}

/// Concatenates flat tensors.
fn joined<R: CubeRuntime>(mut parts: Vec<Buffer<R>>) -> Buffer<R> {
    if parts.len() == 1 { parts.remove(0) } else { Floats::<R>::float_cat(parts, 0) }
}

impl<R: CubeRuntime> Elementary<R> {
    fn second(&self) -> bool {
        self.direction.is_some()
    }

    /// The direction; without one any buffer, since it is not read.
    fn direction(&self) -> Buffer<R> {
        self.direction.as_ref().unwrap_or(&self.inputs[0]).clone()
    }

    fn client(&self) -> &ComputeClient<R> {
        &self.inputs[0].client
    }

    fn cubes(&self, jobs: usize, units: u32) -> CubeCount {
        calculate_cube_count_elemwise(self.client(), jobs, CubeDim::new_1d(units))
    }

    /// An uninitialised flat buffer.
    fn buffer(&self, length: usize) -> Buffer<R> {
        let handle = self.client().empty(length * DType::F32.size());
        let device = self.inputs[0].device.clone();
        CubeTensor::new_contiguous(
            self.client().clone(),
            device,
            [length].into(),
            handle,
            DType::F32,
        )
    }

    /// Number of views of the result.
    fn views(&self) -> usize {
        self.inputs.iter().map(|input| input.shape()[0]).max().unwrap_or(0)
    }

    fn shape(&self, op: ElementaryOp) -> Shape {
        let dims: Vec<_> = self.inputs.iter().map(|input| input.shape().to_vec()).collect();
        op.shape(&dims).into()
    }

    /// The result, flat; in a pass of second order its derivative.
    fn forward(&self, op: ElementaryOp) -> Buffer<R> {
        let out = self.buffer(self.shape(op).num_elements());
        let (client, views, second) = (self.client(), self.views(), self.second());
        let (cube, jobs) = (CubeDim::new_1d(CUBE), length(&out));
        match op {
            ElementaryOp::OrbitMatrix => orbit_matrices::launch(
                client,
                self.cubes(views, CUBE),
                cube,
                self.inputs[0].clone().into_array_arg(),
                self.direction().into_array_arg(),
                out.clone().into_array_arg(),
                views as u32,
                second,
            ),
            ElementaryOp::Perspective => perspective::launch(
                client,
                self.cubes(jobs / 3, CUBE),
                cube,
                self.seen(),
                out.clone().into_array_arg(),
                second,
            ),
            ElementaryOp::Coverage => coverage::launch(
                client,
                self.cubes(jobs, CUBE),
                cube,
                self.inputs[0].clone().into_array_arg(),
                self.direction().into_array_arg(),
                out.clone().into_array_arg(),
                jobs as u32,
                second,
            ),
            ElementaryOp::Loss(_) => judge::launch(
                client,
                self.cubes(views, CUBE),
                cube,
                self.totals(op).into_array_arg(),
                out.clone().into_array_arg(),
                views as u32,
                self.pixels() as u32,
                op.is_iou(),
                second,
            ),
        }
        out
    }

    /// The gradients of `Σ upstream · result` that are wanted, each flat; in a pass of second order their derivatives.
    fn gradients(&self, op: ElementaryOp, upstream: &Buffer<R>, wanted: &[bool]) -> Vec<Buffer<R>> {
        if !wanted.contains(&true) {
            return Vec::new();
        }
        let totals = if op.is_iou() { self.totals(op) } else { upstream.clone() };
        let chosen = (0..self.inputs.len()).filter(|&which| wanted[which]);
        chosen.map(|which| self.gradient(op, which, upstream, &totals)).collect()
    }

    fn gradient(
        &self,
        op: ElementaryOp,
        which: usize,
        upstream: &Buffer<R>,
        totals: &Buffer<R>,
    ) -> Buffer<R> {
        let jobs = length(&self.inputs[which]);
        let out = self.buffer(jobs);
        let (client, views, second) = (self.client(), self.views(), self.second());
        let cube = CubeDim::new_1d(CUBE);
        let upstream = upstream.clone().into_array_arg();
        match op {
            ElementaryOp::OrbitMatrix => to_orbits::launch(
                client,
                self.cubes(views, CUBE),
                cube,
                self.inputs[0].clone().into_array_arg(),
                self.direction().into_array_arg(),
                upstream,
                out.clone().into_array_arg(),
                views as u32,
                second,
            ),
            ElementaryOp::Perspective if which == 0 => to_points::launch(
                client,
                self.cubes(jobs / 3, CUBE),
                cube,
                self.seen(),
                upstream,
                out.clone().into_array_arg(),
                second,
            ),
            ElementaryOp::Perspective => to_matrices::launch(
                client,
                self.cubes(views * camera::UNITS as usize, camera::UNITS),
                CubeDim::new_1d(camera::UNITS),
                self.seen(),
                upstream,
                out.clone().into_array_arg(),
                second,
            ),
            ElementaryOp::Coverage => to_sums::launch(
                client,
                self.cubes(jobs, CUBE),
                cube,
                self.inputs[0].clone().into_array_arg(),
                self.direction().into_array_arg(),
                upstream,
                out.clone().into_array_arg(),
                jobs as u32,
                second,
            ),
            ElementaryOp::Loss(_) => to_image::launch(
                client,
                self.cubes(jobs, CUBE),
                cube,
                self.compared(),
                totals.clone().into_array_arg(),
                upstream,
                out.clone().into_array_arg(),
                jobs as u32,
                which == 1,
                op.is_iou(),
                second,
            ),
        }
        out
    }

    /// Points and matrices.
    fn seen(&self) -> SeenLaunch<R> {
        let [points, matrices] = &self.inputs[..] else { panic!("points and matrices") };
        let (own, count) = (points.shape()[0], points.shape()[1]);
        SeenLaunch::new(
            points.clone().into_array_arg(),
            matrices.clone().into_array_arg(),
            self.direction().into_array_arg(),
            count as u32,
            self.views() as u32,
            if own == 1 { 0 } else { 3 * count as u32 },
            3 * (own * count) as u32,
        )
    }

    /// Number of pixels of an image.
    fn pixels(&self) -> usize {
        length(&self.inputs[0]) / self.inputs[0].shape()[0].max(1)
    }

    fn blocks(&self) -> usize {
        self.pixels().div_ceil(BLOCK as usize)
    }

    /// Two images per view.
    fn compared(&self) -> ComparedLaunch<R> {
        let [one, other] = &self.inputs[..] else { panic!("two images") };
        let pixels = self.pixels();
        let step = |image: &Buffer<R>| if image.shape()[0] == 1 { 0 } else { pixels as u32 };
        let (one_step, other_step) = (step(one), step(other));
        ComparedLaunch::new(
            one.clone().into_array_arg(),
            other.clone().into_array_arg(),
            self.direction().into_array_arg(),
            pixels as u32,
            one_step,
            other_step,
            length(one) as u32,
            self.views() as u32,
            self.blocks() as u32,
        )
    }

    /// Sums over the pixels of each view.
    fn totals(&self, op: ElementaryOp) -> Buffer<R> {
        let (views, blocks) = (self.views(), self.blocks());
        let [partial, totals] = [4 * views * blocks, 4 * views].map(|length| self.buffer(length));
        let cube = CubeDim::new_1d(losses::UNITS);
        add_blocks::launch(
            self.client(),
            self.cubes(views * blocks * losses::UNITS as usize, losses::UNITS),
            cube,
            self.compared(),
            partial.clone().into_array_arg(),
            op.is_iou(),
            self.second(),
        );
        if blocks == 1 {
            return partial;
        }
        add_views::launch(
            self.client(),
            self.cubes(views * losses::UNITS as usize, losses::UNITS),
            cube,
            partial.into_array_arg(),
            totals.clone().into_array_arg(),
            views as u32,
            blocks as u32,
        );
        totals
    }
}
