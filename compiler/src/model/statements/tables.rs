//! `signal r = table("data.csv", "r", fit = linear);`: a variable with its data.

use super::declare::Declaring;
use crate::model::errors::tables::{FORM, Places, TableError};
use crate::model::hir::reserved::did_you_mean;
use crate::model::names::scope::{Meaning, Reported};
use crate::model::{Data, Tensor};
use crate::source::Span;
use crate::source::table::Fit;
use crate::syntax::{self, Arg, Expr, ExprKind};

/// The parts of a `table(..)`.
struct Parts<'f> {
    path: &'f str,
    column: &'f str,
    fit: Fit,
    places: Places,
}

impl<'f, 'e> Declaring<'_, 'f, 'e> {
    /// A signal whose value is a call of `table` with these arguments.
    pub(crate) fn table(
        &mut self,
        named: &'f syntax::Named,
        args: &'f [Arg],
    ) -> Result<Meaning<'e>, Reported> {
        let result = parts(args, named.value.span).and_then(|parts| self.data(named, &parts));
        let value = result.map_err(|error| {
            self.diags.push(error);
            Reported
        })?;
        let name = self.whole_name(&named.name.name);
        let target = self.draft.named(named, name, value.clone());
        Ok(Meaning::Value(value.into(), target))
    }

    /// The variable that stands for the data; the same one wherever it is named.
    fn data(&mut self, named: &syntax::Named, parts: &Parts<'_>) -> Result<Tensor<'e>, TableError> {
        let missing = |why: String| TableError::Missing {
            path: parts.path.to_owned(),
            why,
            span: parts.places.path,
        };
        let source = (self.level.file.data.get(parts.path))
            .ok_or_else(|| missing("files are not read here".into()))?;
        if let Some((tried, reason)) = source.problem() {
            return Err(missing(format!("{tried}: {reason}")));
        }
        let table = source.table(parts.column, parts.fit);
        let (path, column, fit) = (parts.path, parts.column, parts.fit);
        let table =
            table.map_err(|fault| TableError::of(fault, path, column, Some(fit), parts.places))?;
        let known = (self.draft.model.definitions.data.iter())
            .find(|data| std::sync::Arc::ptr_eq(&data.table, &table));
        if let Some(data) = known {
            return Ok(Tensor::scalar(data.var));
        }
        let name = self.whole_name(&named.name.name);
        let var = self.draft.model.exprs.variable(&name);
        self.draft.model.definitions.data.push(Data {
            name,
            var,
            text: format!("table(\"{path}\", \"{column}\", {fit}): {table}"),
            table,
            span: named.span,
        });
        Ok(Tensor::scalar(var))
    }
}

fn parts(args: &[Arg], span: Span) -> Result<Parts<'_>, TableError> {
    let wrong = |what: &str, why: &'static str, span: Span| TableError::Form {
        what: what.to_owned(),
        span,
        why,
        help: FORM.into(),
    };
    let text = |at: usize| match args.get(at) {
        Some(Arg::Positional(
            Expr {
                kind: ExprKind::String(text),
                span,
            },
            binders,
        )) if binders.is_empty() => Some((text.as_str(), *span)),
        _ => None,
    };
    let (Some((path, path_span)), Some((column, column_span))) = (text(0), text(1)) else {
        let what = "`table` takes a file and a column, in quotes";
        return Err(wrong(what, "not two texts", span));
    };
    let (fit, fit_span) = match &args[2..] {
        [] => (Fit::Linear, span),
        [Arg::Named(option, value)] if option.name == "fit" => (fit(value)?, value.span),
        _ => {
            let what = "`table` takes `fit` after the column, and nothing else";
            return Err(wrong(what, "wrong arguments", span));
        }
    };
    Ok(Parts {
        path,
        column,
        fit,
        places: Places {
            path: path_span,
            column: column_span,
            fit: fit_span,
        },
    })
}

fn fit(value: &Expr) -> Result<Fit, TableError> {
    let found = match &value.kind {
        ExprKind::Name(name) => name.as_str(),
        _ => "",
    };
    Fit::ALL
        .into_iter()
        .find(|fit| fit.word() == found)
        .ok_or_else(|| TableError::Form {
            what: match found {
                "" => "`fit` is one of the words `linear`, `hold`, `cubic`".to_owned(),
                found => format!("there is no fit `{found}`"),
            },
            span: value.span,
            why: "not a fit",
            help: did_you_mean(found, Fit::ALL.into_iter().map(Fit::word))
                .unwrap_or_else(|| "write `linear`, `hold` or `cubic`".into()),
        })
}
