//! The functions of a complementarity system with every z an input, made of its equations.
//!
//! The directional form of a row is its derivative along x' = f where it contains something continuous, with u_i in
//! place of z_i':
//!
//! 0 = g(t, x, z)   ->   0 = ∂g/∂t + Σ ∂g/∂x_i f_i + Σ ∂g/∂z_i u_i

use crate::fesd::system::{Disc, Full};
use crate::hybrid::Partials;
use crate::tape::{Sum, Sums, Tape};

/// Below this the square of a slip velocity has no direction.
pub(crate) const NO_DIRECTION: f64 = 1e-300;

/// Where no rate reads u, w' = 0 leaves it open: w' = ε u, with ε relative to the rate of friction, makes it zero.
const OPEN: f64 = 1e-11;

/// What is known of variables and equations.
#[derive(Clone, Copy, Debug)]
pub struct Kinds<'k> {
    /// Whether a z is continuous along solutions.
    pub continuous: &'k [bool],
    /// Whether an equation determines an algebraic state.
    pub determines_state: &'k [bool],
    /// Slip velocities with two entries.
    pub discs: &'k [Disc],
}

/// The directional form in the making.
struct Directions<'k> {
    kinds: Kinds<'k>,
    sums: Sums,
    n: usize,
    /// (f, g) with u in place of z that jumps.
    values: Vec<Sum>,
}

/// Functions with their partial derivatives.
#[derive(Clone, Debug)]
pub struct Functions {
    /// The functions.
    pub tape: Tape,
    /// Their partial derivatives.
    pub slopes: Partials,
}

impl Functions {
    /// Functions with their partial derivatives by some inputs.
    pub(crate) fn new(tape: Tape, by: impl Fn(usize) -> bool) -> Self {
        Functions {
            slopes: partials(&tape, by),
            tape,
        }
    }
}

impl Full {
    /// The functions by (f, g) and α, both of (t, x, z, numbers).
    pub fn new(equations: Tape, alphas: Tape, kinds: Kinds) -> Self {
        let n_z = kinds.continuous.len();
        let n = equations.n_outputs() - kinds.determines_state.len();
        let (z, u) = (1 + n, 1 + n + n_z);
        let n_numbers = equations.n_inputs() - u;
        let mut sums = Sums::new(u + n_z + n_numbers, |input| (z..u).contains(&input));
        let slopes = partials(&equations, |input| input < u);
        // What jumps is u.
        let place = |input: usize| match input {
            input if input < z => input,
            input if input < u && kinds.continuous[input - z] => input,
            input => input + n_z,
        };
        let inputs = 0..equations.n_inputs();
        let inputs: Vec<Sum> = inputs.map(|input| sums.input(place(input))).collect();
        let all: Vec<usize> = (0..u + n_z + n_numbers).collect();
        let values = sums.take(&equations, &inputs);
        let by_inputs = sums.take(&slopes.tape, &inputs);
        let mut directions = Directions {
            kinds,
            sums,
            n,
            values,
        };
        let rows = directions.rows(&slopes.entries, &by_inputs);
        let Directions {
            mut sums, values, ..
        } = directions;
        let directional = sums.tape(&rows, &all);
        let directional_slopes = partials(&directional, |input| (u..u + n_z).contains(&input));
        let mut in_slopes = directional_slopes.tape.needed_inputs().into_iter();
        Full {
            is_affine: !in_slopes.any(|input| (u..u + n_z).contains(&input)),
            rates: sums.tape(&values[..n], &all),
            directional,
            directional_slopes,
            equations,
            slopes,
            alphas,
            determines_state: kinds.determines_state.to_vec(),
        }
    }
}

impl Directions<'_> {
    /// The directional form of g; `entries` are those of ∂(f, g), and `slopes` their values.
    fn rows(&mut self, entries: &[(usize, usize)], slopes: &[Sum]) -> Vec<Sum> {
        let n = self.n;
        let n_z = self.kinds.continuous.len();
        let mut rows: Vec<Sum> = Vec::with_capacity(self.values.len() - n);
        for (row, determines_state) in self.kinds.determines_state.iter().enumerate() {
            let own = entries.iter().zip(slopes);
            let own = own.filter(|((of, _), _)| *of == n + row);
            let own: Vec<(usize, &Sum)> = own.map(|(&(_, input), slope)| (input, slope)).collect();
            let is_continuous = |input: usize| self.kinds.continuous[input - 1 - n];
            let mut inside = own.iter().map(|&(input, _)| input).filter(|i| *i > n);
            let holds_z = inside.clone().next().is_some();
            // What jumps has no part in an equation for a state where it does so: the state is continuous.
            if holds_z && !inside.any(is_continuous) && !determines_state {
                rows.push(self.values[n + row].clone());
                continue;
            }
            let mut along = Sum::number(0.0);
            for (input, slope) in own {
                let term = match input {
                    0 => slope.clone(),
                    _ if input <= n => self.sums.product(slope, &self.values[input - 1]),
                    _ if self.kinds.continuous[input - 1 - n] => {
                        let u = self.sums.input(input + n_z);
                        self.sums.product(slope, &u)
                    }
                    _ => continue,
                };
                along = along.plus(1.0, &term);
            }
            rows.push(along);
        }
        for disc in self.kinds.discs {
            self.direct(disc, &mut rows);
        }
        rows
    }

    /// The directional rows of a disc: with D = w' - s' u,
    ///
    /// - s > 0:  0 = w - s u + u (u·D),  so that u = w/|w| and s' = u·w'
    /// - s = 0:  0 = D, and with that s' and the direction in which w sets off, or u that lets it rest
    fn direct(&mut self, disc: &Disc, rows: &mut [Sum]) {
        let (z, n_z) = (1 + self.n, self.kinds.continuous.len());
        let slip = self.sums.input(z + disc.slip);
        let at_rest = self.sums.take(&at_rest(), &[slip]).swap_remove(0);
        let u = disc.alphas.map(|alpha| {
            let alpha = self.sums.input(z + n_z + alpha);
            Sum::number(-1.0).plus(2.0, &alpha)
        });
        let open = OPEN * disc.friction;
        let rates = [0, 1].map(|k| rows[disc.rows[k]].clone().plus(-open, &u[k]));
        let along = [0, 1].map(|k| self.sums.product(&u[k], &rates[k]));
        let along = along[0].clone().plus(1.0, &along[1]);
        for (k, rate) in rates.into_iter().enumerate() {
            let along = self.sums.product(&u[k], &along);
            let across = self.sums.product(&at_rest, &rate.plus(-1.0, &along));
            let row = self.values[self.n + disc.rows[k]].clone();
            rows[disc.rows[k]] = row.plus(1.0, &along).plus(1.0, &across);
        }
    }
}

/// s to what is one where s = 0, and zero elsewhere.
fn at_rest() -> Tape {
    let mut b = Tape::builder(1);
    let square = b.square(b.input(0));
    let sum = b.offset(NO_DIRECTION, square);
    let share = b.recip(sum);
    let share = b.scale(NO_DIRECTION, share);
    b.finish(&[share])
}

/// The derivatives of the outputs by some of the inputs.
pub(crate) fn partials(functions: &Tape, by: impl Fn(usize) -> bool) -> Partials {
    let (entries, tape) = functions.partials(by);
    Partials { tape, entries }
}
