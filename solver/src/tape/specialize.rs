//! A tape with numbers in place of some of its inputs: what they decide is computed once, and what they cancel is gone.

use super::partial::replay;
use super::term::Term;
use super::{Op, Slot, Tape, UNUSED};

/// A sum of multiples of inputs and a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linear {
    /// Inputs in order, with coefficients that are not zero.
    pub terms: Vec<(usize, f64)>,
    /// The number.
    pub constant: f64,
}

impl Tape {
    /// The tape with these numbers, as a function of the inputs that it still needs; which ones, in order.
    pub fn specialize(&self, number: impl Fn(usize) -> Option<f64>) -> (Self, Vec<usize>) {
        let builder = Tape::builder(self.n_inputs);
        let input = |i: usize| match number(i) {
            Some(number) => Term::Number(number),
            None => Term::value(builder.input(i)),
        };
        let tape = self.replayed(self.n_inputs, input);
        let needed = tape.needed_inputs();
        let place = |i: usize| match needed.binary_search(&i) {
            Ok(at) => Term::value(builder.input(at)),
            Err(_) => Term::ZERO,
        };
        (tape.replayed(needed.len(), place), needed)
    }

    /// The tape with terms of another one's inputs in place of its own.
    fn replayed(&self, n_inputs: usize, input: impl Fn(usize) -> Term) -> Self {
        let mut builder = Tape::builder(n_inputs);
        let mut terms: Vec<Term> = (0..self.n_inputs).map(input).collect();
        terms.resize(self.n_values, Term::ZERO);
        for instruction in &self.values {
            let made = replay(instruction.op, |slot| terms[slot as usize], &mut builder);
            for (slot, term) in [instruction.out, instruction.second].into_iter().zip(made) {
                if slot != UNUSED {
                    terms[slot as usize] = term;
                }
            }
        }
        let outputs = self.outputs.iter();
        let outputs: Vec<_> = outputs
            .map(|&slot| terms[slot as usize].place(&mut builder))
            .collect();
        builder.finish(&outputs)
    }

    /// The inputs that an instruction or an output reads.
    fn needed_inputs(&self) -> Vec<usize> {
        let operands = self.values.iter().flat_map(|one| one.op.operands());
        let read = operands.chain(self.outputs.iter().copied());
        let mut needed: Vec<usize> = read.map(|slot| slot as usize).collect();
        needed.retain(|&slot| slot < self.n_inputs);
        needed.sort_unstable();
        needed.dedup();
        needed
    }
}

impl Linear {
    fn number(constant: f64) -> Self {
        Linear {
            constant,
            ..Linear::default()
        }
    }

    /// `self + c * other`.
    fn plus(mut self, c: f64, other: &Self) -> Self {
        for &(input, factor) in &other.terms {
            match self.terms.binary_search_by_key(&input, |term| term.0) {
                Ok(at) => self.terms[at].1 += c * factor,
                Err(at) => self.terms.insert(at, (input, c * factor)),
            }
        }
        self.terms.retain(|term| term.1 != 0.0);
        self.constant += c * other.constant;
        self
    }

    fn times(&self, c: f64) -> Self {
        Linear::default().plus(c, self)
    }

    fn as_number(&self) -> Option<f64> {
        self.terms.is_empty().then_some(self.constant)
    }
}

impl Tape {
    /// The first output as a sum of multiples of inputs, where it is one by its structure once some inputs are numbers.
    pub fn linear(&self, number: impl Fn(usize) -> Option<f64>) -> Option<Linear> {
        let mut sums: Vec<Option<Linear>> = (0..self.n_inputs)
            .map(|input| {
                Some(match number(input) {
                    Some(number) => Linear::number(number),
                    None => Linear {
                        terms: vec![(input, 1.0)],
                        constant: 0.0,
                    },
                })
            })
            .collect();
        sums.resize(self.n_values, None);
        for instruction in &self.values {
            let sum = instruction.op.linear(|slot| sums[slot as usize].as_ref());
            if instruction.out != UNUSED {
                sums[instruction.out as usize] = sum;
            }
        }
        sums.swap_remove(self.outputs[0] as usize)
    }
}

impl Op {
    /// The result as a sum of multiples, where it is one.
    fn linear<'s>(self, at: impl Fn(Slot) -> Option<&'s Linear>) -> Option<Linear> {
        Some(match self {
            Self::Constant(c) => Linear::number(c),
            Self::Neg(a) => at(a)?.times(-1.0),
            Self::Scale(c, a) => at(a)?.times(c),
            Self::Offset(c, a) => Linear::number(c).plus(1.0, at(a)?),
            Self::SubtractFrom(c, a) => Linear::number(c).plus(-1.0, at(a)?),
            Self::Add(a, b) => at(a)?.clone().plus(1.0, at(b)?),
            Self::Sub(a, b) => at(a)?.clone().plus(-1.0, at(b)?),
            Self::AddScaled(a, c, b) => at(a)?.clone().plus(c, at(b)?),
            Self::Mul(a, b) => match (at(a)?, at(b)?) {
                (a, b) if b.terms.is_empty() => a.times(b.constant),
                (a, b) => b.times(a.as_number()?),
            },
            Self::Div(a, b) => at(a)?.times(1.0 / at(b)?.as_number()?),
            Self::Recip(a) => Linear::number(1.0 / at(a)?.as_number()?),
            Self::Square(a) => Linear::number(at(a)?.as_number()?.powi(2)),
            _ => return None,
        })
    }
}
