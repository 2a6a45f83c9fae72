use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use softrast_tensor::TensorData;

/// The most recently chosen knots and the most recent table. Clones share them.
#[derive(Debug)]
pub(crate) struct Cache<K>(Arc<Mutex<Latest<K>>>);

#[derive(Debug)]
struct Latest<K> {
    knots: Option<K>,
    table: Option<(K, TensorData)>,
}

impl<K: Clone + PartialEq> Cache<K> {
    /// The knots that `reused` derives from the last ones, else those that `choose` returns.
    pub(crate) fn knots(
        &self,
        reused: impl FnOnce(&K) -> Option<K>,
        choose: impl FnOnce() -> K,
    ) -> K {
        if let Some(knots) = self.latest().knots.as_ref().and_then(reused) {
            // The chosen knots stay cached, so that rounding errors do not accumulate.
            return knots;
        }
        // Without the lock: meanwhile, other threads of a pool may take up work and need it.
        let knots = choose();
        self.latest().knots = Some(knots.clone());
        knots
    }

    /// The table at these knots: the cached one, or that of `make`.
    pub(crate) fn table(&self, knots: &K, make: impl FnOnce() -> TensorData) -> TensorData {
        let latest = self.latest().table.clone().filter(|(of, _)| of == knots);
        if let Some((_, table)) = latest {
            return table;
        }
        let table = make();
        self.latest().table = Some((knots.clone(), table.clone()));
        table
    }

    /// A separate cache with the last table, and the knots that `changed` derives from the last ones.
    pub(crate) fn continued(&self, changed: impl FnOnce(&K) -> Option<K>) -> Self {
        let latest = self.latest();
        let knots = latest.knots.as_ref().and_then(changed);
        let table = latest.table.clone().filter(|_| knots.is_some());
        Self(Arc::new(Mutex::new(Latest { knots, table })))
    }

    /// A cache that contains these knots.
    pub(crate) fn beginning_with(knots: K) -> Self {
        Self(Arc::new(Mutex::new(Latest { knots: Some(knots), table: None })))
    }

    fn latest(&self) -> MutexGuard<'_, Latest<K>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<K> Default for Cache<K> {
    fn default() -> Self {
        Self(Arc::new(Mutex::new(Latest { knots: None, table: None })))
    }
}

impl<K> Clone for Cache<K> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}
