/// Width and height in pixels of the tiles that walk together: one cube of units each.
pub(super) const TILE: u32 = 8;
