//! Buffers that a thread keeps from task to task: allocating them in every step takes longer than some steps.

use std::{
    any::{Any, TypeId},
    cell::RefCell,
    collections::HashMap,
};

thread_local! {
    static ROOMS: RefCell<HashMap<TypeId, Box<dyn Any>>> = RefCell::default();
}

/// The buffers that the last task of this thread left, or new ones.
pub(crate) fn taken<R: Default + 'static>() -> Box<R> {
    let last = ROOMS.with_borrow_mut(|rooms| rooms.remove(&TypeId::of::<R>()));
    last.and_then(|room| room.downcast().ok()).unwrap_or_default()
}

/// Leaves buffers for the next task.
pub(crate) fn leave<R: 'static>(room: Box<R>) {
    ROOMS.with_borrow_mut(|rooms| rooms.insert(TypeId::of::<R>(), room));
}
