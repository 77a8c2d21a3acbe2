//! Golden files: the printed DCS of an experiment, kept beside its model.
//!
//! Names and texts only; reading, comparing and writing is up to the caller.

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

/// The golden file of an experiment of the model file `model`.
pub fn golden(model: &Path, experiment: &str, dcs: &Dcs) -> Golden {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    Golden {
        path: model.with_file_name(format!("{stem}.{experiment}.{}.golden", dcs.formulation)),
        text: dcs.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dcs::{fixtures, lower};
    use crate::expr::Exprs;

    #[test]
    fn a_golden_stands_beside_its_model() {
        let exprs = Exprs::new();
        let dcs = lower(&fixtures::relay(&exprs).system, &[]).expect("the system is small");
        let golden = golden(Path::new("models/relay.nsd"), "cross", &dcs);
        assert_eq!(golden.path, Path::new("models/relay.cross.stewart.golden"));
        assert!(golden.text.starts_with("// stewart: "));
    }
}
