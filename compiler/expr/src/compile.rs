//! From expressions to a tape.
//!
//! A shared node is computed once. Sums start with a term that needs no multiplication. A denominator that occurs
//! once is divided by; one that occurs several times is inverted once and multiplied with.

use nsd_solver::tape::{Tape, TapeBuilder, Value};
use rustc_hash::FxHashMap;

use super::nodes::{Data, Id, Nodes};
use super::{BinaryFunction, Expr, Function, Var};

/// What cannot be computed by a tape.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompileError {
    /// A kink or jump that no stage has replaced.
    #[error("`{0}` is nonsmooth and has no place in a tape")]
    Nonsmooth(&'static str),
    /// A variable that is no input.
    #[error("`{0}` is not among the inputs of the tape")]
    NotAnInput(String),
}

/// The tape of `outputs` as functions of `inputs`.
pub fn compile(inputs: &[Var], outputs: &[Expr]) -> Result<Tape, CompileError> {
    let mut builder = Tape::builder(inputs.len());
    let Some(first) = outputs.first() else {
        return Ok(builder.finish(&[]));
    };
    let nodes = first.exprs.nodes();
    let order = nodes.below(outputs.iter().map(|output| output.id));
    let input_of = inputs
        .iter()
        .enumerate()
        .map(|(i, &var)| (var, builder.input(i)));
    let mut compiler = Compiler {
        nodes: &nodes,
        inputs: input_of.collect(),
        denominators: FxHashMap::default(),
        values: FxHashMap::default(),
    };
    for &id in &order {
        compiler.count_denominators(id);
    }
    for id in order {
        let value = compiler.node(&mut builder, id)?;
        compiler.values.insert(id, value);
    }
    let outputs: Vec<_> = outputs
        .iter()
        .map(|output| compiler.values[&output.id])
        .collect();
    Ok(builder.finish(&outputs))
}

struct Compiler<'a> {
    nodes: &'a Nodes,
    inputs: FxHashMap<Var, Value>,
    /// How often a node is divided by.
    denominators: FxHashMap<Id, u32>,
    values: FxHashMap<Id, Value>,
}

impl Compiler<'_> {
    fn count_denominators(&mut self, id: Id) {
        if let Data::Product { start, len } = self.nodes.data(id) {
            let factors = self.nodes.factors(start, len).iter();
            for &(factor, _) in factors.filter(|(_, power)| *power < 0) {
                *self.denominators.entry(factor).or_default() += 1;
            }
        }
    }

    fn node(&self, builder: &mut TapeBuilder, id: Id) -> Result<Value, CompileError> {
        Ok(match self.nodes.data(id) {
            Data::Constant(number) => builder.constant(number),
            Data::Variable(var) => match self.inputs.get(&var) {
                Some(&input) => input,
                None => return Err(CompileError::NotAnInput(self.nodes.name(var).to_owned())),
            },
            Data::Sum {
                constant,
                start,
                len,
            } => self.sum(builder, constant, self.nodes.terms(start, len)),
            Data::Product { start, len } => self.product(builder, self.nodes.factors(start, len)),
            Data::Unary(function, a) => self.unary(builder, function, a)?,
            Data::Binary(function, a, b) => self.binary(builder, function, a, b)?,
        })
    }

    fn sum(&self, builder: &mut TapeBuilder, constant: f64, terms: &[(Id, f64)]) -> Value {
        let value = |id: Id| self.values[&id];
        let plain = terms
            .iter()
            .position(|&(_, coefficient)| coefficient == 1.0);
        let mut constant = constant;
        let start = plain.unwrap_or(0);
        let (term, coefficient) = terms[start];
        let mut total = if coefficient == -1.0 {
            builder.subtract_from(std::mem::take(&mut constant), value(term))
        } else {
            builder.scale(coefficient, value(term))
        };
        for (i, &(term, coefficient)) in terms.iter().enumerate() {
            if i != start {
                total = builder.add_scaled(total, coefficient, value(term));
            }
        }
        builder.offset(constant, total)
    }

    fn product(&self, builder: &mut TapeBuilder, factors: &[(Id, i32)]) -> Value {
        let has_numerator = factors.iter().any(|&(_, power)| power > 0);
        let (mut numerator, mut denominator) = (None, None);
        for &(factor, power) in factors {
            let mut base = self.values[&factor];
            let mut above = power > 0;
            if !above && (!has_numerator || self.denominators[&factor] > 1) {
                base = builder.recip(base);
                above = true;
            }
            let power = builder.powi(base, power.unsigned_abs());
            let side = if above {
                &mut numerator
            } else {
                &mut denominator
            };
            *side = Some(match *side {
                Some(product) => builder.mul(product, power),
                None => power,
            });
        }
        match (numerator, denominator) {
            (Some(numerator), Some(denominator)) => builder.div(numerator, denominator),
            (Some(value), None) => value,
            (None, _) => unreachable!("a product without numerator consists of reciprocals"),
        }
    }

    fn unary(
        &self,
        builder: &mut TapeBuilder,
        function: Function,
        a: Id,
    ) -> Result<Value, CompileError> {
        match function.definition().code {
            Some(code) => Ok(code(builder, self.values[&a])),
            None => Err(CompileError::Nonsmooth(function.name())),
        }
    }

    fn binary(
        &self,
        builder: &mut TapeBuilder,
        function: BinaryFunction,
        a: Id,
        b: Id,
    ) -> Result<Value, CompileError> {
        let power = match self.nodes.data(b) {
            Data::Constant(power) => Some(power),
            _ => None,
        };
        let (a, b) = (self.values[&a], self.values[&b]);
        Ok(match function {
            BinaryFunction::Pow => match power {
                Some(power) => builder.power(a, power),
                None => builder.pow(a, b),
            },
            BinaryFunction::Atan2 => builder.atan2(a, b),
            BinaryFunction::Min | BinaryFunction::Max => {
                return Err(CompileError::Nonsmooth(function.name()));
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::*;
    use crate::Exprs;

    fn tape(inputs: &[Expr], outputs: &[Expr]) -> Tape {
        let inputs: Vec<Var> = inputs
            .iter()
            .filter_map(|input| input.as_variable())
            .collect();
        compile(&inputs, outputs).expect("smooth expressions of the inputs compile")
    }

    #[test]
    fn shared_parts_are_computed_once() {
        let e = Exprs::new();
        let x = e.variables("x", 2);
        let square = x[0] * x[0];
        let outputs = [
            (square + x[1]).sin(),
            (x[1] + square).cos() * square,
            x[0].powi(5),
        ];
        assert_snapshot!(tape(&x, &outputs), @r"
v2 = Square(0)
v3 = Add(1, 2)
v4, v5 = SinCos(3)
v6 = Mul(2, 5)
v7 = Square(2)
v8 = Mul(0, 7)
return v4, v6, v8
");
    }

    #[test]
    fn repeated_denominators_are_inverted_once() {
        let e = Exprs::new();
        let x = e.variables("x", 3);
        assert_snapshot!(tape(&x, &[x[0] / x[2], x[1] / x[2].powi(2)]), @r"
v3 = Recip(2)
v4 = Mul(0, 3)
v5 = Square(3)
v6 = Mul(1, 5)
return v4, v6
");
        assert_snapshot!(tape(&x, &[x[0] / (x[1] * x[2])]), @r"
v3 = Mul(1, 2)
v4 = Div(0, 3)
return v4
");
    }

    #[test]
    fn sums_need_few_multiplications() {
        let e = Exprs::new();
        let x = e.variables("x", 3);
        assert_snapshot!(tape(&x, &[3.0 * x[0] - x[1] + x[2] - 1.0]), @r"
v3 = AddScaled(2, 3.0, 0)
v4 = Sub(3, 1)
v5 = Offset(-1.0, 4)
return v5
");
        assert_snapshot!(tape(&x, &[1.0 - x[0], -x[0] - 2.0 * x[1]]), @r"
v3 = SubtractFrom(1.0, 0)
v4 = Neg(0)
v5 = AddScaled(4, -2.0, 1)
return v3, v5
");
    }

    #[test]
    fn kinks_and_unknown_variables_are_refused() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        let inputs = [x.as_variable().unwrap()];
        assert_eq!(
            compile(&inputs, &[x.abs()]).unwrap_err(),
            CompileError::Nonsmooth("abs")
        );
        assert_eq!(
            compile(&inputs, &[x + y]).unwrap_err(),
            CompileError::NotAnInput("y".into())
        );
    }

    #[test]
    fn a_deep_chain_compiles() {
        let e = Exprs::new();
        let x = e.variable("x");
        let chain = (0..100_000).fold(x, |p, _| (p * 0.5 + 1.0) * x);
        let derivative = chain.diff(x.as_variable().unwrap());
        assert!(tape(&[x], &[chain]).n_registers() < 5);
        let tape = tape(&[x], &[chain, derivative]);
        let mut outputs = [0.0; 2];
        tape.eval(&[0.5], &mut outputs, &mut tape.scratch());
        // p = (p/2 + 1) x has the limit 2x / (2 - x).
        assert!((outputs[0] - 2.0 / 3.0).abs() < 1e-14);
        assert!((outputs[1] - 4.0 / 1.5f64.powi(2)).abs() < 1e-13);
    }
}
