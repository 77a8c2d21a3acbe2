//! The rows one by one, for small problems and for formats that know no kernels.

use super::{Kind, Mpcc, Origin};
use crate::expr::{Expr, Substitution, Var};

/// The unrolled rows of an [`Mpcc`]; parameters stay as they are.
#[derive(Clone, Debug)]
pub struct Flat<'e> {
    /// w.
    pub variables: Vec<Expr<'e>>,
    /// c, a and b, and the terms of F, block by block and place by place.
    pub rows: Vec<Row<'e>>,
}

/// One row.
#[derive(Clone, Debug)]
pub struct Row<'e> {
    /// The name of its block with its place: `collocation[1,1,2]`.
    pub name: String,
    /// What it is.
    pub value: Value<'e>,
    /// Where it comes from.
    pub origin: Origin,
}

/// What a row is.
#[derive(Clone, Copy, Debug)]
pub enum Value<'e> {
    /// What is zero.
    Equation(Expr<'e>),
    /// What is between two bounds.
    Inequality(f64, Expr<'e>, f64),
    /// What is zero for some choices of the members of pairs that are zero.
    Conditional(Expr<'e>),
    /// 0 <= a ⟂ b >= 0.
    Pair(Expr<'e>, Expr<'e>),
    /// A term of F.
    Objective(Expr<'e>),
}

impl<'e> Mpcc<'e> {
    /// All rows as expressions in new variables that have the names of w.
    pub fn flat(&self) -> Flat<'e> {
        let names = self.names();
        let variables: Vec<Expr<'e>> = names.iter().map(|name| self.exprs.variable(name)).collect();
        let mut rows = Vec::new();
        for block in &self.blocks {
            let (kernel, n) = (&block.kernel, block.n_places());
            for place in 0..n {
                let argument = |(i, &formal): (usize, &Var)| {
                    let index = block.arguments[i * n + place];
                    (formal, variables[index as usize])
                };
                let number = |(i, &formal): (usize, &Var)| {
                    (formal, self.exprs.constant(block.numbers[i * n + place]))
                };
                let actual: Substitution = (kernel.variables.iter().enumerate())
                    .map(argument)
                    .chain(kernel.numbers.iter().enumerate().map(number))
                    .collect();
                let values = actual.apply(&kernel.outputs);
                for source in 0..block.sources.len() {
                    let value = match block.kind {
                        Kind::Equation => Value::Equation(values[source]),
                        Kind::Pair => {
                            Value::Pair(values[source], values[values.len() / 2 + source])
                        }
                        Kind::Inequality => {
                            let (lower, upper) = block.bounds[source];
                            Value::Inequality(lower, values[source], upper)
                        }
                        Kind::Conditional => Value::Conditional(values[source]),
                        Kind::Objective | Kind::Steering => Value::Objective(values[source]),
                    };
                    let origin = block.origin(source * n + place);
                    let indices: Vec<String> = origin.place.iter().map(usize::to_string).collect();
                    let name = match indices.is_empty() {
                        true => block.name.to_owned(),
                        false => format!("{}[{}]", block.name, indices.join(",")),
                    };
                    rows.push(Row {
                        name,
                        value,
                        origin,
                    });
                }
            }
        }
        Flat { variables, rows }
    }
}
