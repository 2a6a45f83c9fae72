//! An allocator that counts the bytes in use, and ends the process if there are far too many.
#![allow(unsafe_code, reason = "an allocator cannot be written without")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicUsize, Ordering::Relaxed},
};

/// Bytes in use above which the process ends with the message of the standard library, before the machine runs out of memory.
const MOST: usize = 6 << 30;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// The system allocator, with a count of the bytes in use. For `#[global_allocator]`.
pub struct Allocator;

/// Resets the peak, and returns the bytes in use.
pub(crate) fn begin() -> usize {
    let now = IN_USE.load(Relaxed);
    PEAK.store(now, Relaxed);
    now
}

/// Most bytes in use since the latest [`begin`].
pub(crate) fn peak() -> usize {
    PEAK.load(Relaxed)
}

/// Counts `more` bytes; returns false if there are too many.
fn grow(more: usize) -> bool {
    let now = IN_USE.fetch_add(more, Relaxed).saturating_add(more);
    if now > MOST {
        IN_USE.fetch_sub(more, Relaxed);
        return false;
    }
    PEAK.fetch_max(now, Relaxed);
    true
}

// SAFETY: All calls go to the system allocator unchanged, or return null, which means that there is no memory.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: The caller upholds the contract of the trait, which is also that of `System`.
        if grow(layout.size()) { unsafe { System.alloc(layout) } } else { std::ptr::null_mut() }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: As above.
        if grow(layout.size()) {
            unsafe { System.alloc_zeroed(layout) }
        } else {
            std::ptr::null_mut()
        }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: As above.
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both blocks may exist while the content is copied.
        if !grow(size) {
            return std::ptr::null_mut();
        }
        // SAFETY: As above.
        let moved = unsafe { System.realloc(place, layout, size) };
        IN_USE.fetch_sub(if moved.is_null() { size } else { layout.size() }, Relaxed);
        moved
    }
}
