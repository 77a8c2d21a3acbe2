//! Functions with α among their inputs, on the sides on which they are evaluated.
//!
//! α a + (1 - α) b is a where α is 1, whatever b is: in numbers a large b takes digits of a with it, and one that has no value
//! all of them. So functions are specialized to the α that are 0 or 1, and what was made is kept.

use super::Side;
use super::form::Argument;
use crate::tape::Tape;

/// Functions on as many combinations of sides are kept.
const MOST: usize = 256;

/// Functions of inputs of which some are α.
#[derive(Clone, Debug)]
pub struct Sided {
    whole: Tape,
    /// The inputs that are α, of those that are read.
    alphas: Vec<usize>,
    /// Functions of all inputs, by the sides of these α.
    known: Vec<(Vec<Side>, Tape)>,
    /// Which of them were asked for last.
    now: usize,
    registers: Vec<f64>,
}

/// The side that an α tells.
fn side(alpha: f64) -> Side {
    match alpha {
        0.0 => Side::Minus,
        1.0 => Side::Plus,
        _ => Side::Slide,
    }
}

impl Sided {
    /// Those of a tape, of which these inputs are α.
    pub fn new(whole: Tape, is_alpha: impl Fn(usize) -> bool) -> Self {
        let mut alphas = whole.needed_inputs();
        alphas.retain(|&input| is_alpha(input));
        Sided {
            whole,
            alphas,
            known: Vec::new(),
            now: 0,
            registers: Vec::new(),
        }
    }

    /// The functions on all sides, whose values on one may have the rounding of others.
    pub fn whole(&self) -> &Tape {
        &self.whole
    }

    /// Whether two points, by their inputs, are on one side of all that is read.
    pub fn agree(&self, a: impl Fn(usize) -> f64, b: impl Fn(usize) -> f64) -> bool {
        let mut alphas = self.alphas.iter();
        alphas.all(|&input| side(a(input)) == side(b(input)))
    }

    /// The functions of the same inputs on the sides of a point.
    pub fn on(&mut self, point: impl Fn(usize) -> f64) -> &Tape {
        if self.alphas.is_empty() {
            return &self.whole;
        }
        let holds = |(sides, _): &(Vec<Side>, Tape)| {
            let mut pairs = sides.iter().zip(&self.alphas);
            pairs.all(|(known, &input)| *known == side(point(input)))
        };
        if !self.known.get(self.now).is_some_and(holds) {
            let known = self.known.iter().position(holds);
            self.now = known.unwrap_or_else(|| self.make(point));
        }
        &self.known[self.now].1
    }

    fn make(&mut self, point: impl Fn(usize) -> f64) -> usize {
        let sides: Vec<Side> = self.alphas.iter().map(|&i| side(point(i))).collect();
        let number =
            |input: usize| Argument::Alpha.on(sides[self.alphas.binary_search(&input).ok()?]);
        let tape = self.whole.with_numbers(number);
        if self.known.len() == MOST {
            self.known.clear();
        }
        self.known.push((sides, tape));
        self.known.len() - 1
    }

    /// The values at a point; nothing is allocated on sides that are known.
    pub fn eval(&mut self, inputs: &[f64], outputs: &mut [f64]) {
        let mut registers = std::mem::take(&mut self.registers);
        let tape = self.on(|input| inputs[input]);
        if registers.len() < tape.n_registers() {
            registers.resize(tape.n_registers(), 0.0);
        }
        tape.eval_lanes(inputs, outputs, &mut registers);
        self.registers = registers;
    }
}

#[cfg(test)]
mod tests {
    use super::Sided;
    use crate::tape::Tape;

    /// α (x + L) - L and α log(x) + (1 - α) x, of x and α.
    fn sided(large: f64) -> Sided {
        let mut b = Tape::builder(2);
        let (x, alpha) = (b.input(0), b.input(1));
        let raised = b.offset(large, x);
        let raised = b.mul(raised, alpha);
        let raised = b.offset(-large, raised);
        let log = b.log(x);
        let (log, other) = (b.mul(log, alpha), b.subtract_from(1.0, alpha));
        let other = b.mul(other, x);
        let either = b.add(log, other);
        Sided::new(b.finish(&[raised, either]), |input| input == 1)
    }

    #[test]
    fn what_is_on_other_sides_has_no_part_in_values() {
        for large in [1.0, 1e9, 1e20, f64::MAX] {
            let mut sided = sided(large);
            let mut found = [0.0; 2];
            sided.eval(&[1.3, 1.0], &mut found);
            assert_eq!(found, [1.3, 1.3_f64.ln()]);
            sided.eval(&[-1.3, 0.0], &mut found);
            assert_eq!(found, [-large, -1.3]);
            sided.eval(&[1.0, 1.0], &mut found);
            assert_eq!(found, [1.0, 0.0]);
            assert_eq!(sided.known.len(), 2);
        }
        let mut found = [0.0; 2];
        sided(1.0).eval(&[3.0, 0.5], &mut found);
        assert_eq!(found, [1.0, 0.5 * 3.0_f64.ln() + 1.5]);
    }
}
