//! First and second derivatives of one operation by its operands.

use super::term::Term;
use super::{Op, Slot, TapeBuilder, UNUSED};

/// Derivatives of a result v = op(a, b).
pub(super) struct Partials {
    /// a and b; [`UNUSED`] where there is none. They differ.
    pub operands: [Slot; 2],
    /// ∂v/∂a and ∂v/∂b.
    pub first: [Term; 2],
    /// ∂²v/∂a², ∂²v/∂a∂b and ∂²v/∂b².
    pub second: [Term; 3],
}

/// The term of an operation, and that of the second result of a pair.
pub(super) fn replay(op: Op, at: impl Fn(Slot) -> Term, b: &mut TapeBuilder) -> [Term; 2] {
    let number = Term::Number;
    let result = match op {
        Op::Constant(c) => number(c),
        Op::Neg(x) => at(x).neg(),
        Op::Scale(c, x) => at(x).times(c),
        Op::Offset(c, x) => number(c).add(at(x), b),
        Op::SubtractFrom(c, x) => number(c).sub(at(x), b),
        Op::Add(x, y) => at(x).add(at(y), b),
        Op::Sub(x, y) => at(x).sub(at(y), b),
        Op::AddScaled(x, c, y) => at(x).add(at(y).times(c), b),
        Op::Mul(x, y) => at(x).mul(at(y), b),
        Op::Div(x, y) => at(x).div(at(y), b),
        Op::Recip(x) => at(x).recip(b),
        Op::Square(x) => at(x).square(b),
        Op::Sqrt(x) => at(x).sqrt(b),
        Op::Power(x, c) => at(x).power(c, b),
        Op::Pow(x, y) => at(x).pow(at(y), b),
        Op::Apply(f, x) => at(x).function(f, b),
        Op::SinCos(x) => {
            let sine = at(x).apply(b, f64::sin, |b, x| b.sin_cos(x).0);
            return [sine, at(x).apply(b, f64::cos, |b, x| b.sin_cos(x).1)];
        }
        Op::SinhCosh(x) => {
            let sine = at(x).apply(b, f64::sinh, |b, x| b.sinh_cosh(x).0);
            return [sine, at(x).apply(b, f64::cosh, |b, x| b.sinh_cosh(x).1)];
        }
        Op::Atan2(y, x) => at(y).atan2(at(x), b),
    };
    [result, Term::ZERO]
}

impl Partials {
    /// Derivatives of the result `v` of an operation, or of the second one of a pair; `other` is the other of a pair.
    pub(super) fn new(
        op: Op,
        second: bool,
        v: Term,
        other: Term,
        at: impl Fn(Slot) -> Term,
        b: &mut TapeBuilder,
    ) -> Self {
        let (zero, one) = (Term::ZERO, Term::ONE);
        let linear = |first| (first, [zero; 3]);
        let curved = |first, second| ([first, zero], [second, zero, zero]);
        let (first, second) = match op {
            Op::Constant(_) => linear([zero, zero]),
            Op::Neg(_) | Op::SubtractFrom(..) => linear([one.neg(), zero]),
            Op::Scale(c, _) => linear([Term::Number(c), zero]),
            Op::Offset(..) => linear([one, zero]),
            Op::Add(..) => linear([one, one]),
            Op::Sub(..) => linear([one, one.neg()]),
            Op::AddScaled(_, c, _) => linear([one, Term::Number(c)]),
            Op::Mul(x, y) => ([at(y), at(x)], [zero, one, zero]),
            Op::Div(_, y) => {
                let r = at(y).recip(b);
                let slope = v.mul(r, b).neg();
                let cross = r.square(b).neg();
                ([r, slope], [zero, cross, slope.mul(r, b).times(-2.0)])
            }
            Op::Recip(_) => {
                let square = v.square(b);
                curved(square.neg(), square.mul(v, b).times(2.0))
            }
            Op::Square(x) => curved(at(x).times(2.0), Term::Number(2.0)),
            Op::Sqrt(x) => {
                let slope = v.recip(b).times(0.5);
                curved(slope, slope.div(at(x), b).times(-0.5))
            }
            Op::Power(x, c) => {
                let slope = at(x).power(c - 1.0, b).times(c);
                curved(slope, at(x).power(c - 2.0, b).times(c * (c - 1.0)))
            }
            Op::Pow(x, y) => pow(v, at(x), at(y), b),
            Op::Apply(f, x) => {
                let [slope, second] = f.rate().derivatives(v, at(x), b);
                curved(slope, second)
            }
            // (s, c)' = (c, -s)
            Op::SinCos(_) if second => curved(other.neg(), v.neg()),
            Op::SinCos(_) => curved(other, v.neg()),
            Op::SinhCosh(_) => curved(other, v),
            Op::Atan2(y, x) => {
                let (y, x) = (at(y), at(x));
                let (yy, xx) = (y.square(b), x.square(b));
                let r = yy.add(xx, b).recip(b);
                let rr = r.square(b);
                let twist = x.mul(y, b).mul(rr, b).times(2.0);
                let cross = yy.sub(xx, b).mul(rr, b);
                (
                    [x.mul(r, b), y.mul(r, b).neg()],
                    [twist.neg(), cross, twist],
                )
            }
        };
        Partials {
            operands: op.parts().0,
            first,
            second,
        }
        .merged(b)
    }

    /// A function of a and a is one of a alone.
    fn merged(mut self, b: &mut TapeBuilder) -> Self {
        let [x, y] = self.operands;
        if x == y && x != UNUSED {
            let [aa, ab, bb] = self.second;
            self.operands[1] = UNUSED;
            self.first = [self.first[0].add(self.first[1], b), Term::ZERO];
            let ends = aa.add(bb, b);
            self.second = [ends.add(ab.times(2.0), b), Term::ZERO, Term::ZERO];
        }
        self
    }
}

/// v = x^y: (y x^(y-1), v log x) and (y (y-1) x^(y-2), x^(y-1) (1 + y log x), v log² x).
///
/// The powers are not taken from v, so that they are finite at x = 0 where they can be.
fn pow(v: Term, x: Term, y: Term, b: &mut TapeBuilder) -> ([Term; 2], [Term; 3]) {
    let log = x.log(b);
    let below = y.add(Term::Number(-1.0), b);
    let lower = x.pow(below, b);
    let slope = v.mul(log, b);
    let exponent = y.add(Term::Number(-2.0), b);
    let lowest = x.pow(exponent, b);
    let curvature = y.mul(below, b).mul(lowest, b);
    let cross = y.mul(log, b).add(Term::ONE, b).mul(lower, b);
    (
        [y.mul(lower, b), slope],
        [curvature, cross, slope.mul(log, b)],
    )
}
