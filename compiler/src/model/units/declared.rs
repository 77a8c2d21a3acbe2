//! Units of the quantities of a model, as they are declared: what stands in brackets beside their names.

use std::collections::HashMap;

use crate::expr::{BinaryFunction, Expr, Function, Node};
use crate::model::Model;

/// Units by the names of quantities; a pure number has none.
#[derive(Clone, Debug, Default)]
pub struct Units(HashMap<String, String>);

impl Units {
    /// Those that a model declares, its parts among it, and that of `time`, which has one where anything has.
    pub fn of(model: &Model) -> Self {
        let (all, named) = (&model.quantities, &model.definitions);
        let quantities = (all.params.iter().chain(&all.states).chain(&all.algebraics))
            .chain(all.controls.iter().chain(&all.inputs));
        let quantities = quantities.map(|quantity| (&quantity.name, &quantity.unit));
        let named = named
            .signals
            .iter()
            .chain(&named.lets)
            .chain(&named.outputs);
        let named = named.map(|named| (&named.name, &named.unit));
        let declared = quantities.chain(named);
        let declared = declared.filter_map(|(name, unit)| Some((name.clone(), unit.clone()?)));
        let mut units: HashMap<String, String> = declared.collect();
        if !units.is_empty() {
            units.insert("time".to_owned(), "s".to_owned());
        }
        units.retain(|_, unit| unit != "1");
        Units(units)
    }

    /// The same for figures, with those of `let`, `output` and `signal` that follow from their expressions.
    pub fn shown(model: &Model) -> Self {
        let (mut units, named) = (Units::of(model), &model.definitions);
        let computed = named.signals.iter().chain(&named.lets);
        for named in computed.chain(&named.outputs) {
            units.infer(&named.name, &named.value.data);
        }
        units
    }

    /// Adds the unit of what has none, where its entries are sums of quantities of one unit.
    pub fn infer(&mut self, name: &str, entries: &[Expr<'_>]) {
        if self.unit(name).is_none()
            && let Some(unit) = self.common(entries.iter().copied())
        {
            self.0.insert(name.to_owned(), unit);
        }
    }

    fn common<'e>(&self, mut all: impl Iterator<Item = Expr<'e>>) -> Option<String> {
        let first = self.of_expr(all.next()?)?;
        all.all(|e| self.of_expr(e).as_ref() == Some(&first))
            .then_some(first)
    }

    /// The unit of c1 q1 + c2 q2 + .. + c0 with numbers c, and of absolute values, minima and maxima of such sums.
    fn of_expr(&self, e: Expr<'_>) -> Option<String> {
        match e.node() {
            Node::Variable(var) => self.unit(&e.exprs().name(var)).map(str::to_owned),
            Node::Sum { terms, .. } => self.common(terms.into_iter().map(|(_, term)| term)),
            Node::Unary(Function::Abs, inner) => self.of_expr(inner),
            Node::Binary(BinaryFunction::Min | BinaryFunction::Max, a, b) => {
                let varying = [a, b].into_iter().filter(|e| e.as_constant().is_none());
                self.common(varying)
            }
            _ => None,
        }
    }

    /// The unit of a quantity, or of the one that `x[2]` is an entry of.
    pub fn unit(&self, name: &str) -> Option<&str> {
        let whole = || self.0.get(name.strip_suffix(']')?.rsplit_once('[')?.0);
        self.0.get(name).or_else(whole).map(String::as_str)
    }

    /// The name of a quantity with its unit: `x[2] [m]`.
    pub fn title(&self, name: &str) -> String {
        self.beside(name, name)
    }

    /// A text about a quantity with the unit of that: `x[2] at end [m]`.
    pub fn beside(&self, text: &str, name: &str) -> String {
        match self.unit(name) {
            Some(unit) => format!("{text} [{unit}]"),
            None => text.to_owned(),
        }
    }
}
