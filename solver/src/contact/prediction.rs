//! How far ahead a contact without a force can be judged.
//!
//! Bodies may rest on each other as a pencil rests on its tip: rounding grows like exp(|∂f/∂x| t), and after a while
//! moves what does not move. Of contacts that touch and do not push, only what grows less is taken for a motion.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::TIE;
use crate::hybrid::{Few, Side};

/// What rounding grows by, at most.
const GROWTH: f64 = 100.0;

/// Rounds of the power method, each with the square of |∂f/∂x|: places are moved by speeds, and these by places.
const ROUNDS: usize = 12;

/// The time in which errors grow by so much, where the point is: ln `GROWTH` over the largest eigenvalue of |∂f/∂x|.
pub(crate) fn horizon(mode: &mut Mode) -> f64 {
    let mut entries: Few<(usize, usize, f64)> = Few::new();
    let (library, values) = (&mut mode.library, &mode.memory.values);
    mode.field
        .jacobian(library, values, |row, column, value: f64| {
            entries.push((row, column, value.abs()));
        });
    let times = |v: &[f64], product: &mut [f64]| {
        product.fill(0.0);
        for &(row, column, value) in &entries {
            product[row] += value * v[column];
        }
    };
    let [mut v, mut product] = [1.0, 0.0].map(|value| Few::from_elem(value, mode.n));
    let mut square = 0.0;
    for _ in 0..ROUNDS {
        times(&v, &mut product);
        times(&product, &mut v);
        square = v.iter().copied().fold(0.0, f64::max);
        if !(square > 0.0 && square.is_finite()) {
            return f64::INFINITY;
        }
        v.iter_mut().for_each(|v| *v /= square);
    }
    GROWTH.ln() / square.sqrt()
}

/// True where a contact touches and does not push, open or closed.
pub(crate) fn has_idle_contact(mode: &Mode, state: &State) -> bool {
    let idles = |i: usize| match state.point.sides[i] {
        Side::Slide => (1.0 - state.point.alpha[i]).abs() <= TIE,
        _ => state.bands.armed[i],
    };
    let mut all = 0..state.point.sides.len();
    all.any(|i| mode.system.switches[i].is_contact() && idles(i))
}
