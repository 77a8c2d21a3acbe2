//! Constraints that may be missed at a cost.
//!
//! lower <= v + s⁻ - s⁺ <= upper,   0 <= s⁻, s⁺,   Σ w L (s⁻ + s⁺)   for the norm l1
//! lower <= v - s <= upper,   Σ w L s²   for squares
//!
//! Along the horizon L is the time that an instant stands for: b_m h_kj at nodes, h_kj where elements end, Σ_j h_kj where
//! intervals do, so that the sum is an integral whatever the grid is. At the end L is 1.
//! A weight of l1 that is above the multiplier of the constraint makes it hold exactly (Han & Mangasarian 1979).

use super::points::{Points, stated};
use crate::expr::{Expr, Node};
use crate::lowering::discretize::DiscretizeError;
use crate::lowering::discretize::formals::block::Builder;
use crate::lowering::mpcc::{Bounds, Kind, Mpcc, Slack, Source};
use crate::system::task::{At, Norm, Penalty, TaskRow};

/// What is added at each place of a soft constraint.
struct Soft<'s, 'e> {
    row: &'s TaskRow<'e>,
    penalty: Penalty<'e>,
    /// Names of its slacks, with their factors in v - s.
    slacks: Vec<(String, i8)>,
}

impl<'e> Points<'_, 'e> {
    /// Slacks, rows and cost of the constraint of this number.
    pub(super) fn soften(
        &self,
        number: usize,
        penalty: Penalty<'e>,
        mpcc: &mut Mpcc<'e>,
    ) -> Result<Slack, DiscretizeError> {
        let (formals, layout) = (self.formals, self.formals.layout);
        let exprs = formals.dcs.exprs;
        let row = &self.task.rows[number];
        let soft = Soft::new(row, penalty, number + 1);
        let (end, last) = (layout.end, layout.elements);
        let [k, j] = [layout.each_step(), layout.each_element()];
        let [h, b, one] = [
            exprs.variable("h"),
            exprs.variable("b"),
            exprs.constant(1.0),
        ];
        let values = formals.timed(&[row.value, penalty.weight], h);
        let values = [values[0], values[1]];
        Ok(match row.at {
            At::Start => unreachable!("rows of `initial` are not soft"),
            At::End => {
                let (block, values) = self.at_end(&[row.value, penalty.weight], row.span)?;
                soft.state(block, [values[0], values[1]], one, mpcc)
            }
            At::Nodes => {
                let block = Builder::new("path", [k, j, layout.each_node()]);
                let block = block.number(b, |[_, _, m]| self.weights[m - 1]);
                soft.state(formals.at(block, h, |node| node), values, b * h, mpcc)
            }
            At::Elements => {
                let block = formals.at(Builder::new("path", [k, j]), h, |[k, j]| [k, j, end]);
                formals.check(&block, &values, row.span)?;
                soft.state(block, values, h, mpcc)
            }
            At::Intervals => {
                let lengths = exprs.variables("h", last);
                let block = Builder::new("path", [k]);
                let block = block.vector(&lengths, |[k]| layout.h(k, 1));
                let block = formals.at(block, h, |[k]| [k, last, end]);
                formals.check(&block, &values, row.span)?;
                soft.state(block, values, exprs.sum(lengths), mpcc)
            }
        })
    }
}

/// As a factor is written.
fn factor(e: Expr<'_>) -> String {
    match e.node() {
        Node::Sum { .. } => format!("({e})"),
        _ => e.to_string(),
    }
}

impl<'s, 'e> Soft<'s, 'e> {
    fn new(row: &'s TaskRow<'e>, penalty: Penalty<'e>, number: usize) -> Self {
        let below = (format!("below{number}"), -1);
        let above = (format!("above{number}"), 1);
        let sides = [(row.lower, below), (row.upper, above)];
        let slacks = match penalty.norm {
            Norm::Squared => vec![(format!("off{number}"), 1)],
            Norm::L1 => (sides.into_iter())
                .filter(|(bound, _)| bound.is_finite())
                .map(|(_, slack)| slack)
                .collect(),
        };
        Soft {
            row,
            penalty,
            slacks,
        }
    }

    /// The block has what the value and the weight contain.
    fn state<const N: usize>(
        &self,
        block: Builder<N>,
        [value, weight]: [Expr<'e>; 2],
        length: Expr<'e>,
        mpcc: &mut Mpcc<'e>,
    ) -> Slack {
        let exprs = mpcc.exprs;
        let n = self.slacks.len();
        let norm = self.penalty.norm;
        let bounds = match norm {
            Norm::L1 => Bounds::between(0.0, f64::INFINITY, 0.0),
            Norm::Squared => Bounds::free(0.0),
        };
        let bounds = vec![bounds; n * block.places().count()];
        let names = self.slacks.iter().map(|slack| slack.0.clone()).collect();
        let first = mpcc.declare("s", names, block.ranges(), bounds);
        let s = exprs.variables("s", n);
        let block = block.place_by_place(&s, first);
        let signs: Vec<i8> = self.slacks.iter().map(|slack| slack.1).collect();
        let off = signs.iter().zip(&s);
        let off = exprs.sum(off.map(|(&sign, &s)| f64::from(sign) * s));
        let row = mpcc.blocks.len();
        let written = TaskRow {
            value: self.row.value - off,
            ..self.row.clone()
        };
        mpcc.blocks
            .push(stated(block.clone(), &[value - off], &written));
        let missed = match norm {
            Norm::L1 => exprs.sum(s),
            Norm::Squared => s[0].powi(2),
        };
        let text = format!("{}*{}", factor(self.penalty.weight), factor(missed));
        let sources = vec![Source::Task(self.row.span)];
        let cost = vec![weight * length * missed];
        block.state(mpcc, Kind::Objective, cost, sources, text);
        Slack {
            row,
            penalty: row + 1,
            signs,
            block: mpcc.variables.len() - 1,
        }
    }
}
