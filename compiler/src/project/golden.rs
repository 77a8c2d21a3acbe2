//! Golden files: what an experiment is lowered to, and the numbers of its run, kept beside its model.
//!
//! The goldens of `oscillator.nsd` are in the folder `oscillator.golden`, each with the name of its experiment:
//!
//! - `crossing.system`: the system with its switches, without values of parameters and starts;
//! - `crossing.stewart.dcs`: the complementarity system, where the experiment has one, with its formulation;
//! - `crossing.numbers`: the numbers ([`crate::report::numbers`]).
//!
//! Where a lowering computes with values of parameters, as `timefreezing` does, its numbers are left out, so that another
//! value changes the numbers of the run, but not the form. Names and texts only; reading, comparing and writing is up to
//! the caller.

use std::path::{Path, PathBuf};

use crate::Compiled;
use crate::lowering::dcs;
use crate::system::Structure;

/// Endings of all golden files.
pub const EXTENSIONS: [&str; 3] = ["system", "dcs", "numbers"];

/// A golden file: where it belongs and what it should contain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Golden {
    /// In the folder of the model.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
}

/// The folder of all goldens of a model file, beside it.
pub fn folder(model: &Path) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    model.with_file_name(format!("{stem}.golden"))
}

/// The file with the numbers of an experiment.
pub fn numbers(model: &Path, experiment: &str) -> PathBuf {
    folder(model).join(format!("{experiment}.numbers"))
}

/// The forms of an experiment, stage by stage. A system that has no complementarity form is one form alone.
pub fn forms(model: &Path, compiled: &Compiled<'_>) -> Vec<Golden> {
    let settings = &compiled.settings;
    let file = |ending: &str, text: String| Golden {
        path: folder(model).join(format!("{}.{ending}", settings.name)),
        text,
    };
    let system = file("system", Structure(&compiled.system).to_string());
    let dcs = dcs::lower(&compiled.lowered(), &settings.numerics.lowerings).ok();
    let dcs = dcs.map(|dcs| {
        let text = match settings.freezes() {
            true => without_numbers(&dcs.to_string()),
            false => dcs.to_string(),
        };
        file(&format!("{}.dcs", dcs.lowering.formulation), text)
    });
    [system].into_iter().chain(dcs).collect()
}

/// A printed form with `#` for its numbers, but for 0, 1, exponents and indices.
fn without_numbers(text: &str) -> String {
    let mut shown = String::new();
    let mut rest = text;
    let mut brackets = 0_usize;
    let mut before = ' ';
    while let Some(first) = rest.chars().next() {
        let is_in_name = before.is_alphanumeric() || before == '_';
        let length = match first.is_ascii_digit() && !is_in_name {
            true => number(rest),
            false => first.len_utf8(),
        };
        let (token, behind) = rest.split_at(length);
        brackets = match first {
            '[' => brackets + 1,
            ']' => brackets.saturating_sub(1),
            _ => brackets,
        };
        let is_value = first.is_ascii_digit()
            && !is_in_name
            && !["0", "1"].contains(&token)
            && before != '^'
            && brackets == 0;
        shown.push_str(if is_value { "#" } else { token });
        before = token.chars().next_back().unwrap_or(first);
        rest = behind;
    }
    shown
}

/// The length of the number that a text begins with.
fn number(text: &str) -> usize {
    let digits = |from: usize| {
        let tail = text.as_bytes()[from..].iter();
        from + tail.take_while(|byte| byte.is_ascii_digit()).count()
    };
    let mut end = digits(0);
    if text[end..].starts_with('.') {
        end = digits(end + 1);
    }
    if let Some(exponent) = text[end..].strip_prefix('e') {
        let first = end + 1 + usize::from(exponent.starts_with('-'));
        if digits(first) > first {
            end = digits(first);
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goldens_stand_beside_their_model() {
        let model = Path::new("models/relay.nsd");
        assert_eq!(folder(model), Path::new("models/relay.golden"));
        assert_eq!(
            numbers(model, "cross"),
            Path::new("models/relay.golden/cross.numbers")
        );
    }

    #[test]
    fn values_are_left_out_and_names_are_not() {
        assert_eq!(
            without_numbers("der(q2) = 1.5e-3*x[12]^2 - 25*theta[R1-] + 0 + 1 - 10.25"),
            "der(q2) = #*x[12]^2 - #*theta[R1-] + 0 + 1 - #"
        );
        assert_eq!(
            without_numbers("0 <= θ perp 1 - λ_3 >= 0"),
            "0 <= θ perp 1 - λ_3 >= 0"
        );
    }
}
