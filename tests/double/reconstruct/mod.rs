//! RECONSTRUCT.

mod convolution;
