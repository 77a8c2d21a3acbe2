//! Files of data as a model file names them, each read once.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::{Fault, Fit, Table, read};

/// Largest file of data that is accepted, in bytes.
pub const MAX_BYTES: usize = 64 << 20;

/// The files that one model file names, by their paths as they are written there.
pub type Sources = HashMap<String, Arc<Source>>;

/// A file of data, or why there is none.
pub struct Source {
    /// Its bytes, or where it was looked for and why it cannot be used.
    content: Result<Vec<u8>, (String, String)>,
    known: Mutex<HashMap<(String, Fit), Outcome>>,
}

type Outcome = Result<Arc<Table>, Fault>;

impl Source {
    /// A file that was read.
    pub fn read(bytes: Vec<u8>) -> Self {
        Source {
            content: Ok(bytes),
            known: Mutex::default(),
        }
    }

    /// A file that was looked for as `tried` and cannot be used.
    pub fn missing(tried: String, reason: String) -> Self {
        Source {
            content: Err((tried, reason)),
            known: Mutex::default(),
        }
    }

    /// Where the file was looked for, and why it cannot be used; none where it was read.
    pub fn problem(&self) -> Option<&(String, String)> {
        self.content.as_ref().err()
    }

    /// A column as a function of time; the same one for the same question.
    pub fn table(&self, column: &str, fit: Fit) -> Outcome {
        let bytes = self.content.as_deref().unwrap_or_default();
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let table = known.entry((column.to_owned(), fit));
        table
            .or_insert_with(|| read::table(bytes, column, fit).map(Arc::new))
            .clone()
    }
}

impl Source {
    /// The measurements in a column: times that do not decrease, and values, which are not numbers where none was taken.
    pub(crate) fn measured(&self, column: &str) -> Result<(Vec<f64>, Vec<f64>), Fault> {
        let bytes = self.content.as_deref().unwrap_or_default();
        read::rows(bytes, column, read::Rows::OfMeasurements)
    }
}

impl PartialEq for Source {
    fn eq(&self, other: &Self) -> bool {
        self.content == other.content
    }
}

impl std::fmt::Debug for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.content {
            Ok(bytes) => write!(f, "{} bytes", bytes.len()),
            Err((tried, reason)) => write!(f, "{tried}: {reason}"),
        }
    }
}
