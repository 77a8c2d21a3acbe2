//! A model under the settings of an experiment: what is kept of it, and its numbers.

use rustc_hash::FxHashMap;

use crate::expr::{Expr, Interval, Var, variables_of};
use crate::model::{self, Domain, Model, Quantity, Sliding};
use crate::system::experiment::Settings;
use crate::system::needs::{Extent, Needs};
use crate::system::switches::known::Known;
use crate::system::switches::terms::value_on_sides;
use crate::system::task::Control;
use crate::system::values::Values;
use crate::system::values::limits::Allowed;

/// A model of which an experiment needs a part.
pub(crate) struct Instance<'m, 'e> {
    pub model: &'m Model<'e>,
    pub settings: &'m Settings<'e>,
    pub needs: Needs<'e>,
    /// What is known of parameters.
    pub params: Known,
    /// Variables of all states of the model, by entry.
    pub vars: Vec<Expr<'e>>,
    /// Entries of the states that are kept, ascending.
    pub entries: Vec<usize>,
    /// Places of their variables in the system.
    pub places: FxHashMap<Var, usize>,
}

impl<'m, 'e> Instance<'m, 'e> {
    /// What is kept of a model to this extent.
    pub fn new(model: &'m Model<'e>, settings: &'m Settings<'e>, extent: Extent) -> Self {
        let needs = Needs::of(model, settings, extent);
        let vars: Vec<Expr<'e>> = model.state_vars().collect();
        let entries: Vec<usize> = (0..vars.len()).filter(|&k| needs.entries[k]).collect();
        let places = entries.iter().enumerate();
        let places = places.filter_map(|(place, &entry)| Some((vars[entry].as_variable()?, place)));
        Instance {
            model,
            settings,
            needs,
            params: known(model, settings),
            places: places.collect(),
            vars,
            entries,
        }
    }

    /// Numbers of the experiment.
    pub fn values(&self) -> &'m Values<'e> {
        &self.settings.values
    }

    /// The variable that is time.
    pub fn time(&self) -> Var {
        (self.model.time.as_variable()).expect("time is a variable")
    }

    /// Variables of the states that are kept.
    pub fn states(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        self.entries.iter().map(|&entry| self.vars[entry])
    }

    /// The place of an entry in the system, where it is kept.
    pub fn place(&self, entry: usize) -> Option<usize> {
        self.entries.binary_search(&entry).ok()
    }

    /// The partitions of states that are kept.
    pub fn partitions(&self) -> impl Iterator<Item = &'m model::Partition> {
        let partitions = self.model.partitions.iter();
        partitions.filter(|partition| partition.regions.iter().any(|&r| self.needs.regions[r]))
    }

    /// How a named switch is read.
    pub fn sliding(&self, switch: usize) -> Option<Sliding> {
        let declared = self.model.switches[switch].sliding;
        self.settings.sliding.get(&switch).copied().or(declared)
    }

    /// The value of an expression in parameters, free ones at their guesses.
    pub fn number(&self, e: Expr<'e>) -> f64 {
        let numbers = &self.values().numbers;
        value_on_sides(e, &|var| numbers.get(&var).copied().unwrap_or(f64::NAN))
    }

    /// The variable of a state that is kept, by its place in the system.
    pub fn state(&self, place: usize) -> Var {
        self.vars[self.entries[place]]
            .as_variable()
            .expect("a state is a variable")
    }

    /// dc/dt = ∇c·f + ∂c/∂t for these rates f.
    pub fn rate_of(&self, c: Expr<'e>, rates: &[Expr<'e>]) -> Expr<'e> {
        let vars = variables_of(&[c]).into_iter();
        let moving = vars.filter_map(|var| Some((var, *self.places.get(&var)?)));
        let along = moving.map(|(var, place)| c.diff(var) * rates[place]);
        let exprs = self.model.exprs;
        exprs.sum(along.chain([c.diff(self.time())]))
    }

    /// Whether a bound moves with a free parameter.
    pub fn moves(&self, e: Expr<'e>) -> bool {
        self.values().free.first_in(&[e]).is_some()
    }

    /// Where an entry of a quantity may be, without bounds that move, which are constraints.
    pub fn allowed(
        &self,
        quantity: &Quantity<'e>,
        entry: usize,
        moves: impl Fn(Expr<'e>) -> bool,
    ) -> Option<Allowed> {
        let allowed = Allowed::of(quantity, entry, &|e| self.number(e))?;
        let (Allowed::Between(lower, upper), Some(Domain::Box(lo, hi))) =
            (&allowed, &quantity.domain)
        else {
            return Some(allowed);
        };
        let open = |e: Expr<'e>, number: f64, open: f64| if moves(e) { open } else { number };
        let lower = open(lo.data[entry], *lower, f64::NEG_INFINITY);
        let upper = open(hi.data[entry], *upper, f64::INFINITY);
        Some(Allowed::Between(lower, upper))
    }

    /// The controls that are decided, not given.
    pub fn decided(&self) -> Vec<Control<'e>> {
        let mut controls = Vec::new();
        if !self.settings.decides() {
            return controls;
        }
        for quantity in &self.model.quantities.controls {
            for (k, &var) in quantity.vars.iter().enumerate() {
                let is_given = |var: Var| self.values().signals.get(var).is_some();
                if var.as_variable().is_none_or(is_given) || !self.needs.holds_all(var) {
                    continue;
                }
                let moves = |e: Expr<'e>| self.values().free.decided_in(&[e]).is_some();
                let allowed = self.allowed(quantity, k, moves);
                let default = quantity.value.as_ref().and_then(|value| value.data.get(k));
                let default = default.map_or(0.0, |&e| self.number(e));
                controls.push(Control {
                    name: quantity.shape.entry_name(&quantity.name, k),
                    var,
                    default: if default.is_finite() { default } else { 0.0 },
                    allowed,
                    span: quantity.span,
                });
            }
        }
        controls
    }
}

fn known(model: &Model<'_>, settings: &Settings<'_>) -> Known {
    let values = &settings.values;
    let params = model.quantities.of_params();
    let params = params.filter_map(|var| var.as_variable());
    let freed = settings.optimize.iter().flat_map(|task| &task.params);
    let freed = freed.map(|freed| (freed.var, Interval::new(freed.lower, freed.upper)));
    let ranges: FxHashMap<Var, Interval> = freed.chain(settings.open_ranges(model)).collect();
    // What is free is looked for within its range, wherever its value is.
    let within = |var: Var| {
        let value = values.numbers[&var];
        let range = ranges.get(&var);
        range.map_or(value, |range| value.max(range.low).min(range.high))
    };
    Known {
        numbers: params.map(|var| (var, within(var))).collect(),
        ranges,
    }
}
