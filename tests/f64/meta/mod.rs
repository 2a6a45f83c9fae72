//! Inner loops, their meta-gradients, and learning through them.

mod adam;
mod alternating_descent;
mod inner_loop;
mod meta_gradient;
mod outer_loop;
