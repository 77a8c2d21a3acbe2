//! Functions as sums of multiples of the values of one builder, in which inputs are replaced by other sums.
//!
//! Sums are collected as where a tape is specialized, so that terms that cancel leave nothing.

use rustc_hash::{FxHashMap, FxHashSet};

use super::builder::{Value, slot};
use super::specialize::{Linear, substitute};
use super::{Slot, Tape, TapeBuilder};

/// A coefficient below this share of what it is made of is rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A function of the inputs.
pub(crate) type Sum = Linear<Value>;

/// What functions are made of.
pub(crate) struct Sums {
    n_inputs: usize,
    builder: TapeBuilder,
    /// By value: the inputs that may be replaced and that it depends on, in order.
    reads: Vec<Vec<Slot>>,
}

impl Sums {
    /// Functions of so many inputs, of which these may be replaced.
    pub fn new(n_inputs: usize, is_open: impl Fn(usize) -> bool) -> Self {
        let own = |input: usize| match is_open(input) {
            true => vec![slot(input)],
            false => Vec::new(),
        };
        Sums {
            n_inputs,
            builder: Tape::builder(n_inputs),
            reads: (0..n_inputs).map(own).collect(),
        }
    }

    /// An input.
    pub fn input(&self, index: usize) -> Sum {
        Linear::of(self.builder.input(index))
    }

    /// The outputs of a tape, of which these are the inputs.
    pub fn take(&mut self, tape: &Tape, inputs: &[Sum]) -> Vec<Sum> {
        let outputs = tape.collect(&mut self.builder, |i, _| inputs[i].clone());
        self.follow();
        outputs
    }

    /// The inputs that may be replaced and that a sum depends on, in order.
    pub fn reads(&self, sum: &Sum) -> Vec<usize> {
        let values = sum.terms.iter().map(|(value, _)| value.number() as usize);
        let mut found: Vec<usize> = values
            .flat_map(|value| self.reads[value].iter().map(|&input| input as usize))
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The factor of an input that is multiplied with a number and in no other term; none where it is in others.
    pub fn factor(&self, sum: &Sum, input: usize) -> Option<f64> {
        let mut factor = 0.0;
        for &(value, c) in &sum.terms {
            if value.number() as usize == input {
                factor = c;
            } else if self.reads[value.number() as usize].contains(&slot(input)) {
                return None;
            }
        }
        Some(factor)
    }

    /// A sum with others in place of inputs, all at once.
    pub fn replace<'s>(&mut self, sum: &Sum, by: &impl Fn(usize) -> Option<&'s Sum>) -> Sum {
        let mut known = FxHashMap::default();
        let mut total = sum.without_terms();
        for &(value, factor) in &sum.terms {
            self.remake(value, by, &mut known);
            total = total.plus_rounded(factor, &known[&value.number()], ROUNDING);
        }
        self.follow();
        total
    }

    /// `a * b`.
    pub fn product(&mut self, a: &Sum, b: &Sum) -> Sum {
        let product = a.scaled(b).unwrap_or_else(|| {
            let terms = [a, b].map(|sum| sum.term(&mut self.builder));
            terms[0].mul(terms[1], &mut self.builder).into()
        });
        self.follow();
        product
    }

    /// Sums as functions of some of the inputs, in this order, which are all that they need.
    pub fn tape(&mut self, outputs: &[Sum], inputs: &[usize]) -> Tape {
        let builder = &mut self.builder;
        let placed: Vec<Value> = (outputs.iter())
            .map(|sum| sum.term(builder).place(builder))
            .collect();
        self.follow();
        self.builder.part(&placed, inputs)
    }

    /// Makes a value anew where it depends on what is replaced; what it stands for is known then.
    fn remake<'s>(
        &mut self,
        value: Value,
        by: &impl Fn(usize) -> Option<&'s Sum>,
        known: &mut FxHashMap<Slot, Sum>,
    ) {
        let mut stack = vec![value.number()];
        let mut makers = FxHashSet::default();
        while let Some(number) = stack.pop() {
            if known.contains_key(&number) {
                continue;
            }
            let place = number as usize;
            let is_replaced = |&input: &Slot| by(input as usize).is_some();
            let stays = !self.reads[place].iter().any(is_replaced);
            let is_input = place < self.n_inputs;
            match is_input.then(|| by(place)).flatten() {
                Some(sum) => _ = known.insert(number, sum.clone()),
                None if stays => {
                    let value = self.builder.value(number);
                    let value = value.expect("a term of a sum is a value");
                    known.insert(number, Linear::of(value));
                }
                None => {
                    // A second result stands behind the first one.
                    let maker = self.made_from(number + 1) - 1;
                    if makers.insert(maker) {
                        stack.extend(self.builder.instructions()[maker].op.operands());
                    }
                }
            }
        }
        let mut makers: Vec<usize> = makers.into_iter().collect();
        makers.sort_unstable();
        for maker in makers {
            let instruction = self.builder.instructions()[maker];
            let made = substitute(instruction.op, |slot| &known[&slot], &mut self.builder);
            known.extend(instruction.results().zip(made));
        }
    }

    /// Where the instructions stand whose results begin with a value of at least this number.
    fn made_from(&self, number: Slot) -> usize {
        let instructions = self.builder.instructions();
        instructions.partition_point(|instruction| instruction.out < number)
    }

    /// Notes what new values depend on.
    fn follow(&mut self) {
        let first = self.made_from(slot(self.reads.len()));
        for instruction in &self.builder.instructions()[first..] {
            let mut reads: Vec<Slot> = Vec::new();
            for operand in instruction.op.operands() {
                let own = &self.reads[operand as usize];
                if reads.is_empty() {
                    reads.clone_from(own);
                } else if *own != reads {
                    reads.extend(own);
                    reads.sort_unstable();
                    reads.dedup();
                }
            }
            for _ in instruction.results() {
                self.reads.push(reads.clone());
            }
        }
    }
}
