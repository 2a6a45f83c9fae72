use std::{
    any::Any,
    fmt,
    sync::{Arc, OnceLock},
};

/// A cache of GPU state in an op, which names no runtime: the value of the first call. A call on another runtime finds none.
#[derive(Clone, Default)]
pub(super) struct Kept(Arc<OnceLock<Box<dyn Any + Send + Sync>>>);

impl fmt::Debug for Kept {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_tuple("Kept").field(&self.0.get().is_some()).finish()
    }
}

impl Kept {
    pub(super) fn get<T: Any>(&self) -> Option<&T> {
        self.0.get()?.downcast_ref()
    }

    /// The cached value, else this one.
    pub(super) fn get_or_set<T: Any + Send + Sync>(&self, value: impl FnOnce() -> T) -> Option<&T> {
        self.0.get_or_init(|| Box::new(value())).downcast_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_another_type_is_neither_found_nor_replaced() {
        let kept = Kept::default();
        assert_eq!(kept.get::<u8>(), None);
        assert_eq!(kept.get_or_set(|| 1_u8), Some(&1));
        assert_eq!(kept.get_or_set(|| 2_u16), None);
        assert_eq!((kept.get::<u8>(), kept.get::<u16>()), (Some(&1), None));
    }
}
