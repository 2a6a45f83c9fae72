//! Indices in the corners of OBJ faces.

use crate::{Fault, error::shown};

/// The field of a corner for its vertex.
pub(crate) fn first_field(corner: &str) -> &str {
    corner.split('/').next().unwrap_or(corner)
}

/// The vertex number, from 1, of a corner such as `7`, `7/1/2`, `7//2` or `-1`.
pub(crate) fn absolute(
    corner: &str,
    vertices_read: usize,
    vertices: usize,
) -> Result<usize, Fault> {
    let field = first_field(corner);
    let index = || shown(field);
    let (back, digits) = match field.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, field.strip_prefix('+').unwrap_or(field)),
    };
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(Fault::Index(shown(corner)));
    }
    // A number too long for usize is out of range as well.
    let number = digits.parse().unwrap_or(usize::MAX);
    match (back, number) {
        (true, 1..) if number <= vertices_read => Ok(vertices_read - number + 1),
        (true, 1..) => Err(Fault::TooFarBack { index: index(), before: vertices_read }),
        (false, 1..) if number <= vertices => Ok(number),
        _ => Err(Fault::OutOfRange { index: index(), vertices }),
    }
}
