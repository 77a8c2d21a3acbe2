//! A tape with numbers in place of some of its inputs: what they decide is computed once, and what they cancel is gone.
//!
//! Sums are collected: values are c + Σ c_i v_i over results of other operations, so that terms that cancel leave nothing,
//! rounding included, and are computed where another operation or an output reads them.

use super::partial::replay;
use super::term::{Term, product};
use super::{Op, Slot, Tape, TapeBuilder, UNUSED, Value};
use crate::integrate::two_sum::two_sum;

/// Whether the sum of two numbers has lost digits of the smaller one that matter: by more than this part of it.
pub fn absorbs(a: f64, b: f64, sum: f64) -> bool {
    const ABSORBED: f64 = 1e-12;
    let [small, large] = if a.abs() < b.abs() { [a, b] } else { [b, a] };
    ((sum - large) - small).abs() > ABSORBED * small.abs()
}

/// A sum of multiples of inputs, or of values, and a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear<K = usize> {
    /// What is summed, in order, with coefficients that are not zero.
    pub terms: Vec<(K, f64)>,
    /// The number.
    pub constant: f64,
    /// What it has absorbed: beside 1e20 a 1 is there again once -1e20 is added.
    lost: f64,
}

impl Tape {
    /// The tape with these numbers, as a function of the same inputs.
    pub(crate) fn with_numbers(&self, number: impl Fn(usize) -> Option<f64>) -> Self {
        let mut builder = Self::builder(self.n_inputs);
        let outputs = self.collect(&mut builder, |i, b| match number(i) {
            Some(number) => Linear::number(number),
            None => Linear::of(b.input(i)),
        });
        finish(builder, &outputs)
    }

    /// The tape with these numbers, as a function of the inputs that it still needs; which ones, in order.
    pub fn specialize(&self, number: impl Fn(usize) -> Option<f64>) -> (Self, Vec<usize>) {
        let tape = self.with_numbers(number);
        let needed = tape.needed_inputs();
        let mut builder = Self::builder(needed.len());
        let outputs = tape.collect(&mut builder, |i, b| match needed.binary_search(&i) {
            Ok(at) => Linear::of(b.input(at)),
            Err(_) => Linear::number(0.0),
        });
        (finish(builder, &outputs), needed)
    }

    /// The Jacobian of the outputs by some of the inputs, as a tape of the same inputs with one output per entry that is
    /// not zero by its structure; output and input of each, in order.
    pub fn partials(&self, by: impl Fn(usize) -> bool) -> (Vec<(usize, usize)>, Self) {
        let (mut entries, tape) = self.slopes(by);
        let mut builder = Self::builder(self.n_inputs);
        let mut outputs = tape.collect(&mut builder, |i, b| Linear::of(b.input(i)));
        let mut is_there = outputs.iter().map(|slope| slope.as_number() != Some(0.0));
        entries.retain(|_| is_there.next() == Some(true));
        outputs.retain(|slope| slope.as_number() != Some(0.0));
        (entries, finish(builder, &outputs))
    }

    /// The first output as a sum of multiples of inputs, where it is one by its structure once some inputs are numbers.
    pub fn linear(&self, number: impl Fn(usize) -> Option<f64>) -> Option<Linear> {
        let input = |i: usize| match number(i) {
            Some(number) => Linear::number(number),
            None => Linear::of(i),
        };
        let mut sums: Vec<Option<Linear>> = (0..self.n_inputs).map(|i| Some(input(i))).collect();
        sums.resize(self.n_values, None);
        for instruction in &self.values {
            let sum = instruction.op.linear(|slot| sums[slot as usize].as_ref());
            if instruction.out != UNUSED {
                sums[instruction.out as usize] = sum;
            }
        }
        sums.swap_remove(self.outputs[0] as usize)
            .map(Linear::settled)
    }

    /// The outputs in another tape, with sums of its values in place of inputs.
    pub(super) fn collect(
        &self,
        builder: &mut TapeBuilder,
        input: impl Fn(usize, &TapeBuilder) -> Linear<Value>,
    ) -> Vec<Linear<Value>> {
        let mut sums: Vec<_> = (0..self.n_inputs).map(|i| input(i, builder)).collect();
        sums.resize(self.n_values, Linear::number(0.0));
        for instruction in &self.values {
            let made = substitute(instruction.op, |slot| &sums[slot as usize], builder);
            for (slot, sum) in [instruction.out, instruction.second].into_iter().zip(made) {
                if slot != UNUSED {
                    sums[slot as usize] = sum;
                }
            }
        }
        let outputs = self.outputs.iter();
        outputs.map(|&slot| sums[slot as usize].clone()).collect()
    }

    /// The inputs that an instruction or an output reads.
    pub(crate) fn needed_inputs(&self) -> Vec<usize> {
        let operands = self.values.iter().flat_map(|one| one.op.operands());
        let read = operands.chain(self.outputs.iter().copied());
        let mut needed: Vec<usize> = read.map(|slot| slot as usize).collect();
        needed.retain(|&slot| slot < self.n_inputs);
        needed.sort_unstable();
        needed.dedup();
        needed
    }
}

/// Substitutes sums c + Σ c_i v_i for the operands of an operation. The result is a sum if the operation is linear,
/// else a new value; the second result is that of a pair, sin and cos or sinh and cosh, and 0 without one.
pub(super) fn substitute<'s>(
    op: Op,
    sum: impl Fn(Slot) -> &'s Linear<Value>,
    builder: &mut TapeBuilder,
) -> [Linear<Value>; 2] {
    if let Some(result) = op.linear(|slot| Some(sum(slot))) {
        return [result, Linear::number(0.0)];
    }
    // All operands before the operation: it borrows the builder, too.
    let operands: Vec<Slot> = op.operands().collect();
    let terms: Vec<Term> = (operands.iter())
        .map(|&slot| sum(slot).term(builder))
        .collect();
    let at = |slot: Slot| {
        let place = operands.iter().position(|&operand| operand == slot);
        terms[place.expect("an operation reads its operands")]
    };
    replay(op, at, builder).map(Linear::from)
}

fn finish(mut builder: TapeBuilder, outputs: &[Linear<Value>]) -> Tape {
    let outputs = outputs.iter();
    let placed: Vec<Value> = outputs
        .map(|sum| sum.term(&mut builder).place(&mut builder))
        .collect();
    builder.finish(&placed)
}

impl<K: Copy + Ord> Linear<K> {
    pub(crate) fn number(constant: f64) -> Self {
        Linear {
            terms: Vec::new(),
            constant,
            lost: 0.0,
        }
    }

    pub(crate) fn of(key: K) -> Self {
        Linear {
            terms: vec![(key, 1.0)],
            constant: 0.0,
            lost: 0.0,
        }
    }

    /// Its number, with what that has absorbed.
    pub(super) fn without_terms(&self) -> Self {
        Linear {
            terms: Vec::new(),
            ..*self
        }
    }

    /// `self + c * other`.
    pub(crate) fn plus(self, c: f64, other: &Self) -> Self {
        self.plus_rounded(c, other, 0.0)
    }

    /// The same where a coefficient that is no more than this share of what it is made of is zero.
    pub(super) fn plus_rounded(mut self, c: f64, other: &Self, rounding: f64) -> Self {
        for &(key, factor) in &other.terms {
            match self.terms.binary_search_by_key(&key, |term| term.0) {
                Ok(at) => {
                    let sum = self.terms[at].1 + product(c, factor);
                    // What is no number stays, and so does what has no bound.
                    let is_rounding = sum.abs() <= rounding * (c * factor).abs();
                    let is_rounding = is_rounding && sum.is_finite();
                    self.terms[at].1 = if is_rounding { 0.0 } else { sum };
                }
                Err(at) => self.terms.insert(at, (key, product(c, factor))),
            }
        }
        self.terms.retain(|term| term.1 != 0.0);
        let added = product(c, other.constant);
        let (sum, lost) = two_sum(self.constant, added);
        if sum.is_finite() && absorbs(self.constant, added, sum) {
            self.lost += lost;
        }
        if other.lost != 0.0 {
            self.lost += c * other.lost;
        }
        self.constant = sum;
        self
    }

    /// The number with what it has absorbed.
    fn settled(self) -> Self {
        Linear {
            constant: self.value(),
            lost: 0.0,
            ..self
        }
    }

    fn value(&self) -> f64 {
        self.constant + self.lost
    }

    pub(crate) fn times(&self, c: f64) -> Self {
        Linear::number(0.0).plus(c, self)
    }

    /// Their product where one of them is a number; what the other one has absorbed stays.
    pub(super) fn scaled(&self, other: &Self) -> Option<Self> {
        let is_plain = |one: &Self| one.terms.is_empty() && one.lost == 0.0;
        match is_plain(other) {
            true => Some(self.times(other.constant)),
            false => match self.as_number() {
                Some(number) => Some(other.times(number)),
                None => Some(self.times(other.as_number()?)),
            },
        }
    }

    pub(crate) fn as_number(&self) -> Option<f64> {
        self.terms.is_empty().then_some(self.value())
    }
}

impl Linear<Value> {
    /// It as one term, computed where it is a sum.
    pub(super) fn term(&self, b: &mut TapeBuilder) -> Term {
        match self.terms[..] {
            [] => Term::Number(self.value()),
            [(value, factor)] if self.value() == 0.0 => Term::Multiple(factor, value),
            _ => Term::value(self.place(b)),
        }
    }

    /// Starts with a term that needs no multiplication.
    fn place(&self, b: &mut TapeBuilder) -> Value {
        let start = self.terms.iter().position(|term| term.1 == 1.0);
        let start = start.unwrap_or(0);
        let mut constant = self.value();
        let (value, factor) = self.terms[start];
        let mut total = match factor == -1.0 {
            true => b.subtract_from(std::mem::take(&mut constant), value),
            false => b.scale(factor, value),
        };
        for (i, &(value, factor)) in self.terms.iter().enumerate() {
            if i != start {
                total = b.add_scaled(total, factor, value);
            }
        }
        b.offset(constant, total)
    }
}

impl From<Term> for Linear<Value> {
    fn from(term: Term) -> Self {
        match term {
            Term::Number(constant) => Linear::number(constant),
            Term::Multiple(factor, value) => Linear {
                terms: vec![(value, factor)],
                constant: 0.0,
                lost: 0.0,
            },
        }
    }
}

impl Op {
    /// The result as a sum of multiples, where it is one.
    fn linear<'s, K: Copy + Ord + 's>(
        self,
        at: impl Fn(Slot) -> Option<&'s Linear<K>>,
    ) -> Option<Linear<K>> {
        Some(match self {
            Self::Constant(c) => Linear::number(c),
            Self::Neg(a) => at(a)?.times(-1.0),
            Self::Scale(c, a) => at(a)?.times(c),
            Self::Offset(c, a) => Linear::number(c).plus(1.0, at(a)?),
            Self::SubtractFrom(c, a) => Linear::number(c).plus(-1.0, at(a)?),
            Self::Add(a, b) => at(a)?.clone().plus(1.0, at(b)?),
            Self::Sub(a, b) => at(a)?.clone().plus(-1.0, at(b)?),
            Self::AddScaled(a, c, b) => at(a)?.clone().plus(c, at(b)?),
            Self::Mul(a, b) => at(a)?.scaled(at(b)?)?,
            Self::Div(a, b) => at(a)?.times(1.0 / at(b)?.as_number()?),
            Self::Recip(a) => Linear::number(1.0 / at(a)?.as_number()?),
            Self::Square(a) => Linear::number(at(a)?.as_number()?.powi(2)),
            _ => return None,
        })
    }
}
