//! Golden files: the printed DCS of an experiment, kept beside its model.
//!
//! Everything here works on names and texts; reading and writing is up to the caller.

use std::path::{Path, PathBuf};

use super::Dcs;

/// A golden file: where it belongs and what it should contain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Golden {
    /// `<file stem>.<experiment>.<formulation>.golden`, beside the model.
    pub path: PathBuf,
    /// The printed DCS.
    pub text: String,
}

/// How a golden file compares with what is lowered now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// They are equal.
    Same,
    /// There is no golden file.
    Missing,
    /// The first line that differs.
    Different {
        /// Its number, from 1.
        line: usize,
        /// The line of the golden file; `None` behind its end.
        golden: Option<String>,
        /// The line now; `None` behind the end.
        now: Option<String>,
    },
}

/// The golden file of an experiment of the model file `model`.
pub fn golden(model: &Path, experiment: &str, dcs: &Dcs) -> Golden {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    Golden {
        path: model.with_file_name(format!("{stem}.{experiment}.{}.golden", dcs.formulation)),
        text: dcs.to_string(),
    }
}

impl Golden {
    /// Compares with the content of the file, `None` if there is none; ends of lines may be those of any system.
    pub fn compare(&self, content: Option<&str>) -> Comparison {
        let Some(content) = content else {
            return Comparison::Missing;
        };
        let (mut golden, mut now) = (content.lines(), self.text.lines());
        for line in 1.. {
            match (golden.next(), now.next()) {
                (None, None) => break,
                (a, b) if a == b => {}
                (a, b) => {
                    return Comparison::Different {
                        line,
                        golden: a.map(str::to_owned),
                        now: b.map(str::to_owned),
                    };
                }
            }
        }
        Comparison::Same
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden(text: &str) -> Golden {
        Golden {
            path: PathBuf::new(),
            text: text.to_owned(),
        }
    }

    #[test]
    fn equal_texts_are_the_same_whatever_ends_a_line() {
        let golden = golden("der(x) = 1\n0 = x\n");
        assert_eq!(
            golden.compare(Some("der(x) = 1\r\n0 = x\r\n")),
            Comparison::Same
        );
        assert_eq!(golden.compare(None), Comparison::Missing);
    }

    #[test]
    fn the_first_different_line_is_named() {
        let different = |line, golden: Option<&str>, now: Option<&str>| Comparison::Different {
            line,
            golden: golden.map(str::to_owned),
            now: now.map(str::to_owned),
        };
        let golden = golden("a\nb\n");
        assert_eq!(
            golden.compare(Some("a\nc\n")),
            different(2, Some("c"), Some("b"))
        );
        assert_eq!(golden.compare(Some("a\n")), different(2, None, Some("b")));
        assert_eq!(
            golden.compare(Some("a\nb\nc\n")),
            different(3, Some("c"), None)
        );
    }
}
