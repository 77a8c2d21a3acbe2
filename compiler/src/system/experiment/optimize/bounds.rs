//! Ranges that hold free parameters -> constraints.
//!
//! Where p is free, `control u in [-p, p]` says -p <= u <= p at the ends of control intervals, `state x in [0, p]`
//! 0 <= x <= p at all nodes, and `param q in [0, 1] = 2*p` 0 <= 2 p <= 1. Finite sets are numbers. Where p is an input of runs, the range of a control is one of its variable, whose ends are numbers of a run.

use nsd_solver::integrate::tableau::Family;

use super::super::reader::Reader;
use super::{At, Draft, Shape};
use crate::expr::Expr;
use crate::model::{Domain, Quantity};
use crate::syntax::Relation;

impl<'e> Draft<'_, 'e> {
    /// The constraints of all ranges that are no numbers.
    pub(crate) fn ranges(&mut self, reader: &mut Reader<'_, 'e>) {
        let model = reader.model;
        let start: &[At] = &[At::Start];
        let ends: &[At] = match self.discretization.controls {
            Shape::Constant => &[At::Intervals],
            Shape::Linear => &[At::Start, At::Intervals],
        };
        let nodes: &[At] = match self.discretization.scheme.0 {
            Family::RadauIia => &[At::Nodes],
            _ => &[At::Nodes, At::Elements],
        };
        let groups = [
            ("param", &model.quantities.params, start),
            ("control", &model.quantities.controls, ends),
            ("state", &model.quantities.states, nodes),
            ("algebraic state", &model.quantities.algebraics, nodes),
        ];
        for (kind, quantities, instants) in groups {
            for quantity in quantities {
                for (k, &var) in quantity.vars.iter().enumerate() {
                    self.range(reader, (kind, quantity), (k, var), instants);
                }
            }
        }
    }

    /// The constraints of the range of an entry.
    fn range(
        &mut self,
        reader: &mut Reader<'_, 'e>,
        (kind, quantity): (&str, &Quantity<'e>),
        (k, entry): (usize, Expr<'e>),
        instants: &[At],
    ) {
        let (values, Some(var)) = (reader.values, entry.as_variable()) else {
            return;
        };
        let is_param = kind == "param";
        let decides = |exprs: &[Expr<'e>]| values.free.decided_in(exprs).is_some();
        let is_derived = is_param && values.free.derives(var);
        // What is given follows from other quantities, and is watched only.
        if !is_param && values.signals.contains(&var) {
            return;
        }
        let span = quantity.span;
        match &quantity.domain {
            None => {}
            Some(Domain::Box(lower, upper)) => {
                let ends = [lower.data[k], upper.data[k]];
                let moves = match kind {
                    "param" => is_derived && decides(&[entry]) || decides(&ends),
                    "control" => decides(&ends),
                    _ => values.free.first_in(&ends).is_some(),
                };
                if moves {
                    for &at in instants {
                        let members = vec![ends[0], entry, ends[1]];
                        self.relate(at, members, Relation::LessEqual, span);
                    }
                }
            }
            Some(Domain::Set(set)) => {
                let own: &[Expr<'e>] = if is_derived { &[entry] } else { &[] };
                let Some(free) = values.free.first_in(&[&set[..], own].concat()) else {
                    return;
                };
                let name = quantity.shape.entry_name(&quantity.name, k);
                let what = format!("{kind} `{name}`, which is in a finite set,");
                reader.error(values.depends_on_free(reader.model, what, free, span));
            }
        }
    }
}
