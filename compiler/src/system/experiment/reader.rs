//! Values of settings as numbers and choices.

use rustc_hash::FxHashMap;

use super::error::ExperimentError;
use crate::diagnostics::{Diagnostics, Help};
use crate::expr::Expr;
use crate::model::{Model, Shape, Tensor};
use crate::source::Span;
use crate::syntax::{self, Setting};
use crate::system::values::Values;

/// Reads settings as numbers and choices.
pub(crate) struct Reader<'r, 'e> {
    pub model: &'r Model<'e>,
    pub values: &'r Values<'e>,
    pub diags: &'r mut Diagnostics,
    /// Where settings that may stand once were seen.
    pub seen: FxHashMap<&'static str, Span>,
    pub failed: bool,
}

impl<'e> Reader<'_, 'e> {
    pub fn error(&mut self, error: ExperimentError) {
        self.failed = true;
        self.diags.push(error);
    }

    pub fn once(&mut self, what: &'static str, second: Span) {
        if let Some(first) = self.seen.insert(what, second) {
            self.error(ExperimentError::Twice {
                what: what.to_owned(),
                first,
                second,
            });
        }
    }

    /// The entries as numbers, parameters at their values, with the shape of the value.
    pub fn numbers(&mut self, what: &str, value: &syntax::Expr) -> Option<(Shape, Vec<f64>)> {
        let (tensor, numbers) = self.entries(what, value)?;
        match self.values.free.first_in(&tensor.data) {
            None => Some((tensor.shape, numbers)),
            Some(free) => {
                let what = what.to_owned();
                self.error((self.values).depends_on_free(self.model, what, free, value.span));
                None
            }
        }
    }

    /// The entries, and as numbers, with free parameters at their guesses.
    pub fn entries(&mut self, what: &str, value: &syntax::Expr) -> Option<(Tensor<'e>, Vec<f64>)> {
        let Some(tensor) = self.model.scope.expr(value, None, self.diags) else {
            self.failed = true;
            return None;
        };
        let numbers = self.guesses(what, &tensor.data, value.span)?;
        Some((tensor, numbers))
    }

    /// Expressions in parameters as numbers, with free parameters at their guesses.
    pub fn guesses(&mut self, what: &str, entries: &[Expr<'e>], span: Span) -> Option<Vec<f64>> {
        match self.values.numbers_of(self.model, entries) {
            Ok(numbers) => Some(numbers),
            Err(cause) => {
                let what = what.to_owned();
                self.error(ExperimentError::NotANumber { what, cause, span });
                None
            }
        }
    }

    pub fn within(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        expected: &str,
        fits: impl Fn(f64) -> bool,
    ) -> Option<f64> {
        let (_, numbers) = self.numbers(what, value)?;
        self.one_of(what, value, &numbers, expected, fits)
    }

    /// A number with what it is computed from: free parameters may be among it.
    pub fn follows(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        expected: &str,
        fits: impl Fn(f64) -> bool,
    ) -> Option<(f64, Expr<'e>)> {
        let (tensor, numbers) = self.entries(what, value)?;
        let number = self.one_of(what, value, &numbers, expected, fits)?;
        Some((number, tensor.data[0]))
    }

    /// The one number of a value, where it fits.
    pub fn one_of(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        numbers: &[f64],
        expected: &str,
        fits: impl Fn(f64) -> bool,
    ) -> Option<f64> {
        match *numbers {
            [number] if fits(number) => Some(number),
            _ => {
                self.error(out_of_range(what, value, numbers, expected));
                None
            }
        }
    }

    pub fn positive(&mut self, what: &str, value: &syntax::Expr) -> Option<f64> {
        self.within(what, value, "a positive number", |x| {
            x > 0.0 && x.is_finite()
        })
    }

    pub fn count(&mut self, what: &str, value: &syntax::Expr, most: f64) -> Option<usize> {
        let expected = format!("a whole number from 1 to {most}");
        let number = self.within(what, value, &expected, |x| {
            (1.0..=most).contains(&x) && x.fract() == 0.0
        })?;
        Some(number as usize)
    }

    /// Reports options that are given twice.
    pub fn once_each(&mut self, options: &[Setting]) {
        for (k, option) in options.iter().enumerate() {
            let mut earlier = options[..k].iter();
            if let Some(first) = earlier.find(|first| first.name.name == option.name.name) {
                let what = format!("option `{}`", option.name.name);
                self.error(ExperimentError::Twice {
                    what,
                    first: first.span,
                    second: option.span,
                });
            }
        }
    }
}

/// Numbers that a setting does not take.
pub(crate) fn out_of_range(
    what: &str,
    value: &syntax::Expr,
    numbers: &[f64],
    expected: &str,
) -> ExperimentError {
    let found: Vec<String> = numbers.iter().map(f64::to_string).collect();
    let found = match &found[..] {
        [found] => found.clone(),
        _ => format!("[{}]", found.join(", ")),
    };
    ExperimentError::OutOfRange {
        what: what.to_owned(),
        expected: expected.to_owned(),
        found,
        span: value.span,
    }
}

/// A word that is none of the choices, with the one that is closest.
pub(crate) fn unknown_choice(
    what: &str,
    word: &syntax::Ident,
    choices: &[&str],
) -> ExperimentError {
    let best = choices.iter().max_by(|a, b| {
        strsim::jaro_winkler(&word.name, a).total_cmp(&strsim::jaro_winkler(&word.name, b))
    });
    let close = best.filter(|best| strsim::jaro_winkler(&word.name, best) > 0.75);
    ExperimentError::UnknownChoice {
        what: what.to_owned(),
        found: word.name.clone(),
        span: word.span,
        choices: choices
            .iter()
            .map(|choice| match choice.contains(' ') {
                true => (*choice).to_owned(),
                false => format!("`{choice}`"),
            })
            .collect::<Vec<_>>()
            .join(", "),
        help: close.map(|close| Help::did_you_mean(close)),
    }
}
