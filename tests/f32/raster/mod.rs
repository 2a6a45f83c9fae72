//! The fused op in f32.

mod limits;
mod second_order;
mod soft_blend;
mod threads;
mod tolerance;
