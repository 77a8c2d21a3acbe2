//! A complementarity system in one active set.
//!
//! The zero members are substituted. An equation in which an algebraic variable stands alone, with
//! a constant factor, then gives that variable:
//!
//! 0 = g(t, x, z) + c z_i,  z_i not in g   ->   z_i = -g/c everywhere
//!
//! In a region of Stewart's form this leaves x' = f_r(x), λ = g - g_r, and no unknown; on a surface
//! between two it leaves x' = F θ with one θ, and 0 = g_1 - g_2 in place of their λ and μ.

use std::collections::VecDeque;

use crate::tape::{Sum, Sums};

/// A number next to what it is made of is rounding below this.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// What is left of the equations.
pub(crate) struct Remainder {
    /// Variables that no equation gives, in order.
    pub unknowns: Vec<usize>,
    /// As many equations, 0 = r.
    pub residuals: Vec<Sum>,
    /// All other variables, in terms of unknowns and what is known.
    pub given: Vec<Option<Sum>>,
}

/// An equation that has not given a variable yet.
struct Row {
    sum: Sum,
    /// The largest number that it is made of.
    size: f64,
}

/// Equations, and which of them contain a variable.
struct Elimination<'s> {
    sums: &'s mut Sums,
    rows: Vec<Option<Row>>,
    /// By input.
    holders: Vec<Vec<usize>>,
    is_free: &'s [bool],
}

/// Solves equations for as many of the inputs that are free as stand alone. None where equations contradict each other,
/// or leave another number of unknowns than equations.
pub(crate) fn eliminate(sums: &mut Sums, rows: Vec<Sum>, is_free: &[bool]) -> Option<Remainder> {
    let mut elimination = Elimination {
        sums,
        rows: Vec::with_capacity(rows.len()),
        holders: vec![Vec::new(); is_free.len()],
        is_free,
    };
    for (at, sum) in rows.into_iter().enumerate() {
        elimination.hold(at, &sum);
        let size = sum.constant.abs();
        elimination.rows.push(Some(Row { sum, size }));
    }
    let solved = elimination.solve();
    let Elimination { sums, rows, .. } = elimination;

    // What was solved for later may occur in what was solved for earlier.
    let mut given: Vec<Option<Sum>> = vec![None; is_free.len()];
    for (input, value) in solved.into_iter().rev() {
        let value = sums.replace(&value, &|input| given[input].as_ref());
        given[input] = Some(value);
    }
    let mut residuals = Vec::new();
    for Row { sum, size } in rows.into_iter().flatten() {
        match sum.as_number() {
            Some(number) if number.abs() <= ROUNDING * size => {}
            Some(_) => return None,
            None => residuals.push(sum),
        }
    }
    let is_unknown = |&input: &usize| is_free[input] && given[input].is_none();
    let unknowns: Vec<usize> = (0..is_free.len()).filter(is_unknown).collect();
    (unknowns.len() == residuals.len()).then_some(Remainder {
        unknowns,
        residuals,
        given,
    })
}

impl Elimination<'_> {
    /// Notes the variables of a row.
    fn hold(&mut self, at: usize, sum: &Sum) {
        for input in self.sums.reads(sum) {
            let known = &mut self.holders[input];
            if self.is_free[input] && !known.contains(&at) {
                known.push(at);
            }
        }
    }

    /// Variables and their values, each in terms of those that come later and of unknowns.
    fn solve(&mut self) -> Vec<(usize, Sum)> {
        let mut solved: Vec<(usize, Sum)> = Vec::new();
        let mut queue: VecDeque<usize> = (0..self.rows.len()).collect();
        while let Some(at) = queue.pop_front() {
            let Some(row) = &self.rows[at] else { continue };
            let Some((input, value)) = self.alone(&row.sum) else {
                continue;
            };
            self.rows[at] = None;
            for other in std::mem::take(&mut self.holders[input]) {
                let Some(Row { sum, size }) = self.rows[other].take() else {
                    continue;
                };
                let by = |read: usize| (read == input).then_some(&value);
                let sum = self.sums.replace(&sum, &by);
                self.hold(other, &sum);
                let size = size.max(value.constant.abs()).max(sum.constant.abs());
                self.rows[other] = Some(Row { sum, size });
                queue.push_back(other);
            }
            solved.push((input, value));
        }
        solved
    }

    /// The variable that a row gives, and its value: one that occurs in the fewest other rows.
    fn alone(&self, row: &Sum) -> Option<(usize, Sum)> {
        let candidates = self.sums.reads(row).into_iter();
        let mut candidates: Vec<(usize, usize)> = candidates
            .filter(|&input| self.is_free[input])
            .map(|input| (self.holders[input].len(), input))
            .collect();
        candidates.sort_unstable();
        candidates.into_iter().find_map(|(_, input)| {
            let factor = self.sums.factor(row, input)?;
            let rest = row.clone().plus(-factor, &self.sums.input(input));
            Some((input, rest.times(-1.0 / factor)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::Tape;

    /// Rows of z_0 and z_1, inputs 1 and 2 behind x, as the sums that they are; what is left, with the values of z
    /// at x = 3.
    fn eliminated(rows: Tape) -> Option<(Remainder, Vec<Option<f64>>)> {
        let mut sums = Sums::new(3, |input| input > 0);
        let inputs = [0, 1, 2].map(|input| sums.input(input));
        let rows = sums.take(&rows, &inputs);
        let remainder = eliminate(&mut sums, rows, &[false, true, true])?;
        let value = |sum: &Option<Sum>| {
            let tape = sums.tape(&[sum.clone()?], &[0, 1, 2]);
            let mut value = [0.0];
            tape.eval(&[3.0, f64::NAN, f64::NAN], &mut value, &mut tape.scratch());
            Some(value[0])
        };
        let values: Vec<Option<f64>> = remainder.given.iter().map(value).collect();
        Some((remainder, values))
    }

    /// 0 = c + Σ c_j z_j, row by row.
    fn affine(rows: &[[f64; 3]]) -> Tape {
        let mut b = Tape::builder(3);
        let rows = rows.iter().map(|&[c, first, second]| {
            let terms = [(1, first), (2, second)].map(|(input, c)| b.scale(c, b.input(input)));
            let sum = b.add(terms[0], terms[1]);
            b.offset(c, sum)
        });
        let rows: Vec<_> = rows.collect();
        b.finish(&rows)
    }

    #[test]
    fn what_stands_alone_is_put_into_the_other_rows() {
        // 0 = z_0 x - 2 z_1,  0 = sin(x) + 4 z_0 - 1: z_0 = (1 - sin x)/4 and z_1 = x z_0/2.
        let mut b = Tape::builder(3);
        let product = b.mul(b.input(0), b.input(1));
        let first = b.add_scaled(product, -2.0, b.input(2));
        let (sin, _) = b.sin_cos(b.input(0));
        let second = b.add_scaled(sin, 4.0, b.input(1));
        let second = b.offset(-1.0, second);
        let (remainder, values) =
            eliminated(b.finish(&[first, second])).expect("it has a solution");
        assert!(remainder.unknowns.is_empty() && remainder.residuals.is_empty());
        let z = (1.0 - 3.0_f64.sin()) / 4.0;
        assert!((values[1].expect("z_0 is given") - z).abs() < 1e-15);
        assert!((values[2].expect("z_1 is given") - 1.5 * z).abs() < 1e-15);
    }

    #[test]
    fn what_stands_nowhere_alone_is_unknown() {
        // 0 = z_0² - x,  0 = z_0 + z_1
        let mut b = Tape::builder(3);
        let square = b.square(b.input(1));
        let first = b.sub(square, b.input(0));
        let second = b.add(b.input(1), b.input(2));
        let (remainder, values) =
            eliminated(b.finish(&[first, second])).expect("it has a solution");
        assert_eq!(
            (&remainder.unknowns[..], remainder.residuals.len()),
            (&[1][..], 1)
        );
        assert!(values[1].is_none() && values[2].is_some());
    }

    #[test]
    fn rounding_is_no_contradiction() {
        let sums = [[-0.1, 1.0, 0.0], [-0.2, -1.0, 1.0], [-0.3, 0.0, 1.0]];
        let (_, values) = eliminated(affine(&sums)).expect("0.1 + 0.2 is 0.3");
        assert_eq!(values[1], Some(0.1));
        assert!(eliminated(affine(&[[-0.1, 1.0, 0.0], [-0.1001, 1.0, 0.0]])).is_none());
    }

    #[test]
    fn rounding_determines_nothing() {
        // 0.1 z_0 + 0.2 z_0 - 0.3 z_1 for z_0 = z_1
        let rows = affine(&[[0.0, 1.0, -1.0], [0.0, 0.1 + 0.2, -0.3]]);
        assert!(eliminated(rows).is_none());
    }
}
