//! Files of which some have other texts than on disk, as editors have them, and which of them were read.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use crate::source::files::{Disk, FileError, Files};

/// Texts that are not on disk as they are, by what makes a file the same; all others are on disk.
#[derive(Clone, Debug, Default)]
pub struct Texts {
    texts: BTreeMap<String, Arc<str>>,
    /// Which files were asked for, as they were before they were read.
    asked: Arc<Mutex<Seen>>,
}

/// Files by what makes them the same: when each was changed, and how long it is, where it is there.
pub type Seen = BTreeMap<String, Option<(SystemTime, u64)>>;

/// What files are like on disk now.
pub fn look<'k>(keys: impl IntoIterator<Item = &'k String>) -> Seen {
    let seen = |key: &String| {
        let known = fs::metadata(key).ok();
        let known = known.and_then(|known| Some((known.modified().ok()?, known.len())));
        (key.clone(), known)
    };
    keys.into_iter().map(seen).collect()
}

impl Files for Texts {
    fn read(&self, path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
        let key = self.key(path);
        let text = self.texts.get(&key);
        if let Ok(mut asked) = self.asked.lock()
            && !asked.contains_key(&key)
        {
            asked.append(&mut look([&key]));
        }
        match text {
            Some(text) => Ok(text.bytes().take(limit.saturating_add(1)).collect()),
            None => Disk.read(path, limit),
        }
    }

    fn key(&self, path: &Path) -> String {
        Disk.key(path)
    }
}

impl Texts {
    /// The text of a file that is not on disk as it is.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.texts.get(key).map(|text| &**text)
    }

    /// A file has another text than on disk.
    pub fn set(&mut self, key: String, text: String) {
        self.texts.insert(key, text.into());
    }

    /// A file is as it is on disk.
    pub fn forget(&mut self, key: &str) {
        self.texts.remove(key);
    }

    /// Whether a file was asked for.
    pub fn has_asked(&self, key: &str) -> bool {
        let asked = self.asked.lock();
        asked.is_ok_and(|asked| asked.contains_key(key))
    }

    /// All files that were asked for, whether they are there or not, as they were before they were read.
    pub fn asked(&self) -> Seen {
        let asked = self.asked.lock();
        asked.map_or_else(|_| Seen::new(), |asked| asked.clone())
    }

    /// The same with others in their place; none of them has been asked for yet.
    pub fn with(&self, others: impl IntoIterator<Item = (String, String)>) -> Texts {
        let mut texts = self.texts.clone();
        let others = others.into_iter();
        texts.extend(others.map(|(key, text)| (key, text.into())));
        let asked = Arc::default();
        Texts { texts, asked }
    }
}
