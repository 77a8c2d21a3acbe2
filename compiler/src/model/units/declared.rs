//! Units of the quantities of a model, as they are declared: what stands in brackets beside their names.

use std::collections::HashMap;

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
