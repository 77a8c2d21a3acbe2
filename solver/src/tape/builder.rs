//! Building a tape: equal operations are shared, unneeded ones are dropped.

use std::cell::Cell;

use rustc_hash::FxHashMap;

use super::allocate::allocate;
use super::taylor::steps::Kind;
use super::{Elementary, Instruction, Op, Slot, Tape, UNUSED};

/// A value of the tape under construction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Value(Slot);

impl Value {
    pub(super) fn number(self) -> Slot {
        self.0
    }
}

type Key = (Kind, [Slot; 2], u64);

/// Collects operations; every method gives the value of its result.
#[derive(Clone, Debug)]
pub struct TapeBuilder {
    n_inputs: usize,
    n_values: usize,
    instructions: Vec<Instruction>,
    known: FxHashMap<Key, Slot>,
}

macro_rules! unary {
    ($($(#[$doc:meta])* $method:ident => $Op:ident;)*) => {
        $($(#[$doc])* pub fn $method(&mut self, a: Value) -> Value {
            self.push(Op::$Op(a.0))
        })*
    };
}

impl TapeBuilder {
    pub(super) fn new(n_inputs: usize) -> Self {
        Self {
            n_inputs,
            n_values: n_inputs,
            instructions: Vec::new(),
            known: FxHashMap::default(),
        }
    }

    /// The value of an input.
    pub fn input(&self, index: usize) -> Value {
        assert!(
            index < self.n_inputs,
            "the tape has {} inputs",
            self.n_inputs
        );
        Value(slot(index))
    }

    /// A number.
    pub fn constant(&mut self, c: f64) -> Value {
        self.push(Op::Constant(c))
    }

    /// `c * a`.
    pub fn scale(&mut self, c: f64, a: Value) -> Value {
        match c {
            1.0 => a,
            -1.0 => self.neg(a),
            _ => self.push(Op::Scale(c, a.0)),
        }
    }

    /// `c + a`.
    pub fn offset(&mut self, c: f64, a: Value) -> Value {
        if c == 0.0 {
            a
        } else {
            self.push(Op::Offset(c, a.0))
        }
    }

    /// `c - a`.
    pub fn subtract_from(&mut self, c: f64, a: Value) -> Value {
        if c == 0.0 {
            self.neg(a)
        } else {
            self.push(Op::SubtractFrom(c, a.0))
        }
    }

    /// `a + b`.
    pub fn add(&mut self, a: Value, b: Value) -> Value {
        self.push(Op::Add(a.0.min(b.0), a.0.max(b.0)))
    }

    /// `a - b`.
    pub fn sub(&mut self, a: Value, b: Value) -> Value {
        self.push(Op::Sub(a.0, b.0))
    }

    /// `a + c * b`.
    pub fn add_scaled(&mut self, a: Value, c: f64, b: Value) -> Value {
        match c {
            1.0 => self.add(a, b),
            -1.0 => self.sub(a, b),
            _ => self.push(Op::AddScaled(a.0, c, b.0)),
        }
    }

    /// `a * b`.
    pub fn mul(&mut self, a: Value, b: Value) -> Value {
        if a == b {
            return self.square(a);
        }
        self.push(Op::Mul(a.0.min(b.0), a.0.max(b.0)))
    }

    /// `a / b`.
    pub fn div(&mut self, a: Value, b: Value) -> Value {
        self.push(Op::Div(a.0, b.0))
    }

    /// `a ^ power` by squaring; all powers of one value share their squares.
    pub fn powi(&mut self, a: Value, power: u32) -> Value {
        let mut result = None;
        let mut square = a;
        for bit in 0..u32::BITS - power.leading_zeros() {
            if bit > 0 {
                square = self.square(square);
            }
            if power >> bit & 1 == 1 {
                result = Some(match result {
                    Some(result) => self.mul(result, square),
                    None => square,
                });
            }
        }
        result.unwrap_or_else(|| self.constant(1.0))
    }

    /// `a ^ power` with a number that is no integer.
    pub fn power(&mut self, a: Value, power: f64) -> Value {
        if power == 0.5 {
            self.sqrt(a)
        } else {
            self.push(Op::Power(a.0, power))
        }
    }

    /// `a ^ b`.
    pub fn pow(&mut self, a: Value, b: Value) -> Value {
        self.push(Op::Pow(a.0, b.0))
    }

    /// `f(a)`.
    pub fn apply(&mut self, f: Elementary, a: Value) -> Value {
        self.push(Op::Apply(f, a.0))
    }

    /// The angle of the point `(x, y)`.
    pub fn atan2(&mut self, y: Value, x: Value) -> Value {
        self.push(Op::Atan2(y.0, x.0))
    }

    /// The sine and the cosine.
    pub fn sin_cos(&mut self, a: Value) -> (Value, Value) {
        let sine = self.push(Op::SinCos(a.0));
        (sine, Value(sine.0 + 1))
    }

    /// The hyperbolic sine and cosine.
    pub fn sinh_cosh(&mut self, a: Value) -> (Value, Value) {
        let sine = self.push(Op::SinhCosh(a.0));
        (sine, Value(sine.0 + 1))
    }

    unary! {
        /// `-a`.
        neg => Neg;
        /// `1 / a`.
        recip => Recip;
        /// `a * a`.
        square => Square;
        /// The square root.
        sqrt => Sqrt;
    }

    /// The tape with these outputs.
    pub fn finish(self, outputs: &[Value]) -> Tape {
        let inputs: Vec<usize> = (0..self.n_inputs).collect();
        self.part(outputs, &inputs)
    }

    /// The same of some of the inputs, in this order, which are all that the outputs need.
    pub(super) fn part(&self, outputs: &[Value], inputs: &[usize]) -> Tape {
        // Mark what the outputs need, going backwards.
        let mut needed = vec![false; self.n_values];
        outputs
            .iter()
            .for_each(|value| needed[value.0 as usize] = true);
        for instruction in self.instructions.iter().rev() {
            if instruction.results().any(|value| needed[value as usize]) {
                instruction
                    .op
                    .operands()
                    .for_each(|value| needed[value as usize] = true);
            }
        }

        // Number the inputs, and the values that stay.
        let mut number = vec![UNUSED; self.n_values];
        for (place, &input) in inputs.iter().enumerate() {
            number[input] = slot(place);
        }
        let is_there = |input: usize| !needed[input] || number[input] != UNUSED;
        debug_assert!(
            (0..self.n_inputs).all(is_there),
            "what is needed is an input"
        );
        let mut n_values = slot(inputs.len());
        let mut values = Vec::new();
        let mut wanted = Vec::new();
        for instruction in &self.instructions {
            if !instruction.results().any(|value| needed[value as usize]) {
                continue;
            }
            wanted.extend(instruction.results().map(|value| needed[value as usize]));
            let op = instruction.op.map(|value| number[value as usize]);
            let mut define = |value: Slot| {
                if value == UNUSED {
                    return UNUSED;
                }
                number[value as usize] = n_values;
                n_values += 1;
                n_values - 1
            };
            let (out, second) = (define(instruction.out), define(instruction.second));
            values.push(Instruction { op, out, second });
        }
        let outputs = outputs
            .iter()
            .map(|value| number[value.0 as usize])
            .collect();
        allocate(inputs.len(), values, outputs, &wanted)
    }

    /// All instructions, in order.
    pub(super) fn instructions(&self) -> &[Instruction] {
        &self.instructions
    }

    /// Which values depend on these inputs.
    pub(super) fn depends<F: Fn(usize) -> bool>(&self, on: F) -> impl Fn(Value) -> bool + use<F> {
        let mut depends = vec![false; self.n_values];
        for (input, depends) in depends[..self.n_inputs].iter_mut().enumerate() {
            *depends = on(input);
        }
        for instruction in &self.instructions {
            if (instruction.op.operands()).any(|operand| depends[operand as usize]) {
                (instruction.results()).for_each(|value| depends[value as usize] = true);
            }
        }
        move |value| depends[value.0 as usize]
    }

    /// An operation on values as they are numbered here; none where one of them is not defined.
    pub(super) fn repeat(&mut self, op: Op) -> Option<Value> {
        let is_known = Cell::new(true);
        let _ = op.map(|value| {
            is_known.set(is_known.get() && (value as usize) < self.n_values);
            value
        });
        is_known.get().then(|| self.push(op))
    }

    /// The value of a number, if it is defined.
    pub(super) fn value(&self, number: Slot) -> Option<Value> {
        ((number as usize) < self.n_values).then_some(Value(number))
    }

    fn push(&mut self, op: Op) -> Value {
        let (operands, c) = op.parts();
        let next = slot(self.n_values);
        let known = self
            .known
            .entry((Kind::of(op), operands, c.to_bits()))
            .or_insert(next);
        if *known == next {
            let pair = matches!(op, Op::SinCos(_) | Op::SinhCosh(_));
            let second = if pair { next + 1 } else { UNUSED };
            self.instructions.push(Instruction {
                op,
                out: next,
                second,
            });
            self.n_values += 1 + usize::from(pair);
        }
        Value(*known)
    }
}

impl Instruction {
    pub(super) fn results(&self) -> impl Iterator<Item = Slot> + use<> {
        [self.out, self.second]
            .into_iter()
            .filter(|&slot| slot != UNUSED)
    }
}

pub(super) fn slot(index: usize) -> Slot {
    Slot::try_from(index).expect("a tape holds fewer than 2^32 values")
}
