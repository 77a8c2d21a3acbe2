//! Numbers with units as numbers.

use super::Lowering;
use crate::diagnostics::{Applicability, Help};
use crate::model::names::scope::{Meaning, Reported, Value};
use crate::model::units::literal;
use crate::model::{ModelError, Tensor, UnitError};
use crate::source::Span;
use crate::syntax::Unit;

/// A number of units, in coherent ones.
#[inline(never)]
pub(crate) fn quantity<'e>(
    lowering: &mut Lowering<'_, 'e>,
    value: f64,
    unit: &Unit,
    span: Span,
) -> Result<Value<'e>, Reported> {
    let is_value = |name: &str| {
        let visible = lowering.names.visible(name);
        lowering.names.is_local(name)
            || visible.is_some_and(|meaning| !matches!(meaning, Meaning::Word(_)))
    };
    let mut words = literal::words(unit).into_iter();
    if let Some(name) = words.find(|name| is_value(name)) {
        return lowering.error(ModelError::UnitOrValue {
            name: name.to_owned(),
            help: Some(Help::edit(
                format!(
                    "write `{value} ({unit})` for the quantity, and `*` or parentheses, as in `(2 m)/s`, around a value"
                ),
                format!("({unit})"),
                Applicability::Suggestion,
            )),
            span: unit.span,
        });
    }
    match literal::value(value, unit) {
        Some(value) => Ok(Tensor::scalar(lowering.constant(value)).into()),
        None => lowering.error(UnitError::UnitPower { span }),
    }
}
