use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use softrast_tensor::TensorData;

/// The knots that were chosen last and the table that was made last. Clones share them.
#[derive(Debug)]
pub(crate) struct Cache<K>(Arc<Mutex<Latest<K>>>);

#[derive(Debug)]
struct Latest<K> {
    knots: Option<K>,
    table: Option<(K, TensorData)>,
}

impl<K: Clone + PartialEq> Cache<K> {
    /// The knots that `reused` makes of the last ones, or those that `choose` finds.
    pub(crate) fn knots(
        &self,
        reused: impl FnOnce(&K) -> Option<K>,
        choose: impl FnOnce() -> K,
    ) -> K {
        if let Some(knots) = self.latest().knots.as_ref().and_then(reused) {
            // The chosen ones stay, so that no rounding piles up.
            return knots;
        }
        // Without the lock: other threads of a pool may take up work in between, and ask for the same.
        let knots = choose();
        self.latest().knots = Some(knots.clone());
        knots
    }

    /// The table at these knots, which `make` makes unless it was the last.
    pub(crate) fn table(&self, knots: &K, make: impl FnOnce() -> TensorData) -> TensorData {
        let latest = self.latest().table.clone().filter(|(of, _)| of == knots);
        if let Some((_, table)) = latest {
            return table;
        }
        let table = make();
        self.latest().table = Some((knots.clone(), table.clone()));
        table
    }

    /// One of its own that begins with what `changed` makes of the last knots, and with the last table.
    pub(crate) fn continued(&self, changed: impl FnOnce(&K) -> Option<K>) -> Self {
        let latest = self.latest();
        let knots = latest.knots.as_ref().and_then(changed);
        let table = latest.table.clone().filter(|_| knots.is_some());
        Self(Arc::new(Mutex::new(Latest { knots, table })))
    }

    /// One that begins with these knots.
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
