//! Jacobians and Hessians of tapes, as tapes.
//!
//! A sweep backwards through the values of a tape carries the adjoint v̄ of every value v and, for Hessians, the
//! second derivatives w(v, u) of the weighted outputs by pairs of values that still stand for what is behind them.
//! At v = φ(p, q) both move to the operands:
//!
//! w(p, u) += φ_p w(v, u),   w(p, q) += φ_p φ_q w(v, v) + v̄ φ_pq,   p̄ += φ_p v̄
//!
//! Gower & Mello 2012, *A new framework for the computation of Hessians* (edge pushing). Nothing that is zero by
//! structure is ever touched, so the patterns are those of the function and the work is that of the sparse Hessian.
//! The values are taken depth first: a term of a sum is done with before the next one, so that the terms of a long sum
//! do not all meet each other.

use std::collections::BTreeMap;

use super::builder::Value;
use super::partial::{Partials, replay};
use super::term::Term;
use super::{Instruction, Slot, Tape, TapeBuilder, UNUSED};

/// Derivatives that are not structurally zero.
///
/// The first entries contain an input that is differentiated by, or a weight, and are the outputs of `tape`; the
/// others are those of `constant` and stay what they are while these inputs change. Both tapes have the same inputs.
#[derive(Clone, Debug)]
pub struct Derivative {
    /// Output and input of each entry of a Jacobian; inputs i >= j of one of a Hessian.
    pub entries: Vec<(u32, u32)>,
    /// The entries that change.
    pub tape: Tape,
    /// The entries that do not.
    pub constant: Tape,
}

impl Tape {
    /// The derivatives of the outputs by some of the inputs, as a tape of the same inputs, with output and input of each,
    /// in order.
    pub(super) fn slopes(&self, by: impl Fn(usize) -> bool) -> (Vec<(usize, usize)>, Self) {
        let mut sweep = Sweep::new(self, by, 0);
        let (mut entries, mut terms) = (Vec::new(), Vec::new());
        for i in 0..self.n_outputs() {
            let adjoints = sweep.gradient(sweep.outputs[i]).into_iter();
            for (j, term) in adjoints.filter(|(_, term)| !term.is_zero()) {
                entries.push((i, j as usize));
                terms.push(term.place(&mut sweep.builder));
            }
        }
        (entries, sweep.builder.finish(&terms))
    }

    /// The Jacobian of the outputs by the first `n` inputs, as functions of all inputs.
    pub fn jacobian(&self, n: usize) -> Derivative {
        let mut sweep = Sweep::new(self, |input| input < n, 0);
        let mut entries = Vec::new();
        for i in 0..self.n_outputs() {
            let adjoints = sweep.gradient(sweep.outputs[i]);
            entries.extend(adjoints.into_iter().map(|(j, term)| ((i as u32, j), term)));
        }
        sweep.finish(n, entries)
    }

    /// The lower triangle of the Hessian of Σ y_i out_i by the first `n` inputs; y are inputs behind those of the tape.
    pub fn hessian(&self, n: usize) -> Derivative {
        let mut sweep = Sweep::new(self, |input| input < n, self.n_outputs());
        let entries = sweep.curvature();
        sweep.finish(n, entries)
    }
}

/// The values of a tape in the tape of its derivatives.
struct Sweep<'t> {
    tape: &'t Tape,
    /// Its instructions and outputs, depth first.
    instructions: Vec<Instruction>,
    outputs: Vec<Slot>,
    builder: TapeBuilder,
    /// The tape's values in the new one.
    terms: Vec<Term>,
    /// The instruction that makes each value behind the inputs.
    makers: Vec<u32>,
    /// Whether a value depends on the inputs that are differentiated by.
    active: Vec<bool>,
}

/// Terms of values, the last value first.
type Adjoints = BTreeMap<Slot, Term>;

impl<'t> Sweep<'t> {
    fn new(tape: &'t Tape, by: impl Fn(usize) -> bool, n_weights: usize) -> Self {
        let mut builder = Tape::builder(tape.n_inputs + n_weights);
        let mut terms = vec![Term::ZERO; tape.n_values];
        let mut active = vec![false; tape.n_values];
        for (input, active) in active[..tape.n_inputs].iter_mut().enumerate() {
            *active = by(input);
        }
        for (i, term) in terms[..tape.n_inputs].iter_mut().enumerate() {
            *term = Term::value(builder.input(i));
        }
        let (instructions, outputs) = depth_first(tape);
        let mut makers = vec![0; tape.n_values - tape.n_inputs];
        for (number, instruction) in instructions.iter().enumerate() {
            let made = replay(instruction.op, |slot| terms[slot as usize], &mut builder);
            let depends = instruction.op.operands().any(|slot| active[slot as usize]);
            for (slot, term) in [instruction.out, instruction.second].into_iter().zip(made) {
                if slot != UNUSED {
                    let value = slot as usize;
                    terms[value] = term;
                    active[value] = depends;
                    makers[value - tape.n_inputs] = number as u32;
                }
            }
        }
        Sweep {
            tape,
            instructions,
            outputs,
            builder,
            terms,
            makers,
            active,
        }
    }

    /// Derivatives of the operation that makes a value.
    fn partials(&mut self, value: Slot) -> Partials {
        let maker = self.makers[value as usize - self.tape.n_inputs];
        let instruction = self.instructions[maker as usize];
        let second = value == instruction.second;
        let other = if second {
            instruction.out
        } else {
            instruction.second
        };
        let terms = &self.terms;
        let other = if other == UNUSED {
            Term::ZERO
        } else {
            terms[other as usize]
        };
        let at = |slot: Slot| terms[slot as usize];
        let v = terms[value as usize];
        Partials::new(instruction.op, second, v, other, at, &mut self.builder)
    }

    /// Takes the last value that is not an input out of `adjoints`, unless there is none left.
    fn next(&self, adjoints: &mut Adjoints) -> Option<(Slot, Term)> {
        let last = adjoints.last_entry()?;
        (*last.key() as usize >= self.tape.n_inputs).then(|| last.remove_entry())
    }

    /// The operands that count, with their places.
    fn operands(&self, partials: &Partials) -> impl Iterator<Item = (usize, Slot)> + use<'_, 't> {
        let operands = partials.operands.into_iter().enumerate();
        operands.filter(|&(_, slot)| slot != UNUSED && self.active[slot as usize])
    }

    /// The derivatives of a value by the inputs.
    fn gradient(&mut self, output: Slot) -> Adjoints {
        let mut adjoints = Adjoints::new();
        if self.active[output as usize] {
            adjoints.insert(output, Term::ONE);
        }
        while let Some((value, adjoint)) = self.next(&mut adjoints) {
            let partials = self.partials(value);
            let operands: Vec<_> = self.operands(&partials).collect();
            for (i, operand) in operands {
                let term = product(partials.first[i], adjoint, &mut self.builder);
                accumulate(&mut adjoints, operand, term, &mut self.builder);
            }
        }
        adjoints
    }

    /// The second derivatives of the weighted outputs.
    fn curvature(&mut self) -> Vec<((u32, u32), Term)> {
        let mut adjoints = Adjoints::new();
        for (i, &output) in self.outputs.iter().enumerate() {
            if self.active[output as usize] {
                let weight = Term::value(self.builder.input(self.tape.n_inputs + i));
                accumulate(&mut adjoints, output, weight, &mut self.builder);
            }
        }
        let mut pairs = vec![Adjoints::new(); self.tape.n_values];
        while let Some((value, adjoint)) = self.next(&mut adjoints) {
            let partials = self.partials(value);
            let operands: Vec<_> = self.operands(&partials).collect();
            let b = &mut self.builder;
            let mut of_value = std::mem::take(&mut pairs[value as usize]);
            let own = of_value.remove(&value).unwrap_or(Term::ZERO);
            for &(i, p) in &operands {
                let slope = partials.first[i];
                for (&u, &w) in &of_value {
                    let term = product(slope, w, b);
                    let twice = if u == p { 2.0 } else { 1.0 };
                    accumulate_pair(&mut pairs, p, u, term.times(twice), b);
                }
            }
            for (at, &(i, p)) in operands.iter().enumerate() {
                for &(j, q) in &operands[at..] {
                    let slopes = product(partials.first[i], partials.first[j], b);
                    let pushed = product(slopes, own, b);
                    let made = product(partials.second[i + j], adjoint, b);
                    let term = pushed.add(made, b);
                    accumulate_pair(&mut pairs, p, q, term, b);
                }
            }
            for (i, operand) in operands {
                let term = product(partials.first[i], adjoint, b);
                accumulate(&mut adjoints, operand, term, b);
            }
        }
        let inputs = pairs.into_iter().take(self.tape.n_inputs).enumerate();
        let entries = inputs.flat_map(|(i, row)| {
            let row = row.into_iter();
            row.map(move |(j, term)| ((i as u32, j), term))
        });
        entries.collect()
    }

    /// Splits the entries by what they depend on.
    fn finish(self, n: usize, entries: Vec<((u32, u32), Term)>) -> Derivative {
        let mut builder = self.builder;
        let entries = entries.into_iter().filter(|(_, term)| !term.is_zero());
        let placed: Vec<((u32, u32), Value)> = entries
            .map(|(entry, term)| (entry, term.place(&mut builder)))
            .collect();
        let n_inputs = self.tape.n_inputs;
        let changes = builder.depends(|input| input < n || input >= n_inputs);
        let (changing, fixed): (Vec<_>, Vec<_>) =
            placed.into_iter().partition(|&(_, value)| changes(value));
        let values = |entries: &[((u32, u32), Value)]| -> Vec<Value> {
            entries.iter().map(|&(_, value)| value).collect()
        };
        let constant = builder.clone().finish(&values(&fixed));
        let tape = builder.finish(&values(&changing));
        let entries = changing.iter().chain(&fixed).map(|&(entry, _)| entry);
        Derivative {
            entries: entries.collect(),
            tape,
            constant,
        }
    }
}

/// The instructions of a tape with its outputs, renumbered: whatever an instruction reads is made just before it,
/// unless it has been made already.
fn depth_first(tape: &Tape) -> (Vec<Instruction>, Vec<Slot>) {
    let n_inputs = tape.n_inputs as Slot;
    let mut makers = vec![UNUSED; tape.n_values];
    let mut depths = vec![0; tape.n_values];
    for (number, instruction) in tape.values.iter().enumerate() {
        let operands = instruction.op.operands();
        let depth = operands.map(|operand| depths[operand as usize]).max();
        for value in instruction.results() {
            makers[value as usize] = number as Slot;
            depths[value as usize] = 1 + depth.unwrap_or(0);
        }
    }
    let mut number: Vec<Slot> = (0..tape.n_values as Slot).collect();
    let mut next = n_inputs;
    let mut is_done = vec![false; tape.values.len()];
    let mut ordered = Vec::with_capacity(tape.values.len());
    let mut stack: Vec<Slot> = Vec::new();
    for &output in &tape.outputs {
        stack.push(output);
        while let Some(&value) = stack.last() {
            let maker = makers[value as usize];
            if maker == UNUSED || is_done[maker as usize] {
                stack.pop();
                continue;
            }
            let instruction = tape.values[maker as usize];
            let is_open = |&operand: &Slot| match makers[operand as usize] {
                UNUSED => false,
                maker => !is_done[maker as usize],
            };
            // The deeper operand is on top: what a long sum has so far, before its next term.
            let depth = stack.len();
            stack.extend(instruction.op.operands().filter(is_open));
            if stack.len() > depth {
                stack[depth..].sort_by_key(|&operand| depths[operand as usize]);
                continue;
            }
            is_done[maker as usize] = true;
            let op = instruction.op.map(|value| number[value as usize]);
            let mut define = |value: Slot| {
                if value != UNUSED {
                    number[value as usize] = next;
                    next += 1;
                }
            };
            define(instruction.out);
            define(instruction.second);
            let [out, second] = [instruction.out, instruction.second].map(|value| match value {
                UNUSED => UNUSED,
                value => number[value as usize],
            });
            ordered.push(Instruction { op, out, second });
        }
    }
    let outputs = tape.outputs.iter().map(|&value| number[value as usize]);
    (ordered, outputs.collect())
}

/// What is zero by structure stays zero, whatever it is multiplied with: a coefficient may be infinite.
fn product(x: Term, y: Term, b: &mut TapeBuilder) -> Term {
    if x.is_zero() || y.is_zero() {
        return Term::ZERO;
    }
    x.mul(y, b)
}

/// Adds a term; a value is in the map from then on, even where the sum is zero.
fn accumulate(terms: &mut Adjoints, slot: Slot, term: Term, b: &mut TapeBuilder) {
    let sum = terms.entry(slot).or_insert(Term::ZERO);
    *sum = sum.add(term, b);
}

fn accumulate_pair(pairs: &mut [Adjoints], p: Slot, q: Slot, term: Term, b: &mut TapeBuilder) {
    if !term.is_zero() {
        let (last, first) = (p.max(q), p.min(q));
        accumulate(&mut pairs[last as usize], first, term, b);
    }
}
