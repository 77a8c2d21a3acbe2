//! The files that a project has read, so that it can be taken elsewhere.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use nsdc::files::{Disk, FileError, Files, Memory};

/// Files from memory, or else from the disk where that is open; what is read is kept.
#[derive(Clone, Default)]
pub struct Recorded {
    memory: Memory,
    reads_disk: bool,
    read: Arc<Mutex<BTreeMap<PathBuf, Vec<u8>>>>,
}

impl Recorded {
    /// Files that are given, and those of the disk where `reads_disk`.
    pub fn new(files: Vec<(String, Vec<u8>)>, reads_disk: bool) -> Self {
        Recorded {
            memory: files.into_iter().collect(),
            reads_disk,
            read: Arc::default(),
        }
    }

    /// What has been read so far, by path.
    pub fn files(&self) -> Vec<(String, Vec<u8>)> {
        let read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        let files = read.iter();
        let files = files.map(|(path, bytes)| (path.display().to_string(), bytes.clone()));
        files.collect()
    }
}

impl Files for Recorded {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        let known = self.memory.read(path, limit);
        let bytes = match known {
            Err(_) if self.reads_disk => Disk.read(path, limit),
            known => known,
        }?;
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        read.insert(path.to_owned(), bytes.clone());
        Ok(bytes)
    }

    fn key(&self, path: &Path) -> String {
        match self.reads_disk {
            true => Disk.key(path),
            false => self.memory.key(path),
        }
    }
}
