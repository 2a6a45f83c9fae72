//! Inner loops, their meta-gradients, and learning through them.

mod adam;
mod inner_loop;
mod joint_loop;
mod learner;
mod meta_gradient;
