//! The functions of active sets, made when a run meets them first.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::fesd::system::{ComplementaritySystem, Reduced, Zero};

/// What has been made of the functions of one system; copies share it.
#[derive(Clone, Debug, Default)]
pub struct Library(FxHashMap<Vec<Zero>, Option<Arc<Reduced>>>);

impl Library {
    /// The functions while these members are zero.
    pub(crate) fn reduced(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
    ) -> Option<Arc<Reduced>> {
        if let Some(known) = self.0.get(zeros) {
            return known.clone();
        }
        let reduced = system.reduced(zeros).map(Arc::new);
        self.0.insert(zeros.to_vec(), reduced.clone());
        reduced
    }
}
