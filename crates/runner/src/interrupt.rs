use std::{
    process,
    sync::atomic::{AtomicBool, Ordering},
};

use crate::error::INTERRUPTED;

/// Whether the user has asked the program to stop.
pub(crate) static STOP: AtomicBool = AtomicBool::new(false);

/// Lets Ctrl-C stop the work after the step in progress; a second one ends the program at once.
pub(crate) fn listen() {
    // Without a handler Ctrl-C ends the program at once, which loses no finished batch either.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            process::exit(INTERRUPTED.into());
        }
        eprintln!("\nstopping after this step; Ctrl-C once more ends at once");
    });
}
