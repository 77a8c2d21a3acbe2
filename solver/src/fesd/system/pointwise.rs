//! z in one point, where switching functions may have jumped.
//!
//! Off all surfaces the sides determine z: the linear programs that the pairs state have one solution there. On a
//! surface this takes the middle: α = 1/2, and the middle of a disc.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::fesd::system::ComplementaritySystem;
use crate::fesd::system::units::Units;
use crate::hybrid::Side;
use crate::tape::Tape;

/// A switch of time is on its surface where |ψ| is at most this share of Σ |v ∂ψ/∂v| over time and data v: some thousand
/// roundings of these.
const SURFACE: f64 = 1e-12;

/// A gap below this, in its unit, is no rounding.
const OUTSIDE: f64 = 1e-10;

/// A point of a disc is on its edge within this.
const EDGE: f64 = 4.0 * f64::EPSILON;

/// ψ, and what follows from it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Surfaces {
    /// (t, x, α, numbers) to ψ of all switches, which contain α of earlier ones only, and behind them to indicators.
    pub psi: Tape,
    /// z by ψ and α, as they are stated.
    pub rules: Rules,
    /// The units that z is in.
    pub units: Units,
    /// Unilateral switches, whose ψ are gaps.
    pub gaps: Vec<usize>,
    /// Switches of time, in order, with which other ψ jump.
    pub leading: Vec<Leading>,
}

/// A switch of time with which other ψ jump.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Leading {
    /// Which one.
    pub switch: usize,
    /// (t, x, α, numbers) to its ψ, and to the terms that move it.
    pub terms: Tape,
}

/// z in a point by ψ, with indicators behind them, and α.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rules {
    /// What regions compare, g = Σ c_j ψ_j: terms (j, c_j).
    pub compared: Vec<Vec<(usize, f64)>>,
    /// Every z, in order; products come last.
    pub z: Vec<Rule>,
}

/// What a z is in a point.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Rule {
    /// Zero.
    Zero,
    /// α of a switch.
    Alpha(usize),
    /// max(ψ, 0) of a switch.
    Above(usize),
    /// max(-ψ, 0) of a switch.
    Below(usize),
    /// 1 - α of a unilateral switch, which is zero above its surface.
    Force(usize),
    /// |w| of a slip velocity with two entries.
    Speed([usize; 2]),
    /// 1 - |u|² of one.
    Inside([usize; 2]),
    /// Π α, or 1 - α, of switches.
    Share(Vec<(usize, bool)>),
    /// g - min g, for what a region compares among those of a subsystem.
    Excess(usize, Range<usize>),
    /// min g.
    Least(Range<usize>),
    /// What makes an equation zero that states it, 0 = z - product.
    Product(usize),
}

impl Rules {
    /// The values of all z, zero for products.
    pub fn values(&self, psi: &[f64], alpha: &[f64]) -> Vec<f64> {
        let g = |terms: &Vec<(usize, f64)>| terms.iter().map(|&(j, c)| c * psi[j]).sum();
        let g: Vec<f64> = self.compared.iter().map(g).collect();
        let rules = self.z.iter();
        rules.map(|rule| rule.value(psi, alpha, &g)).collect()
    }
}

impl Rule {
    fn value(&self, psi: &[f64], alpha: &[f64], g: &[f64]) -> f64 {
        let least = |range: &Range<usize>| {
            let all = g[range.clone()].iter().copied();
            all.fold(f64::INFINITY, f64::min)
        };
        match self {
            Rule::Zero | Rule::Product(_) => 0.0,
            Rule::Alpha(k) => alpha[*k],
            Rule::Above(k) => psi[*k].max(0.0),
            Rule::Below(k) => (-psi[*k]).max(0.0),
            Rule::Force(k) if psi[*k] > 0.0 => 0.0,
            Rule::Force(k) => 1.0 - alpha[*k],
            Rule::Speed([first, second]) => psi[*first].hypot(psi[*second]),
            Rule::Inside(both) => {
                let squares = both.map(|k| (2.0 * alpha[k] - 1.0).powi(2));
                let inside = 1.0 - squares[0] - squares[1];
                if inside <= EDGE { 0.0 } else { inside }
            }
            Rule::Share(own) => {
                let weight = |&(k, above): &(usize, bool)| match above {
                    true => alpha[k],
                    false => 1.0 - alpha[k],
                };
                own.iter().map(weight).product()
            }
            Rule::Excess(own, range) => g[*own] - least(range),
            Rule::Least(range) => least(range),
        }
    }
}

/// α = step(ψ), 1/2 on the surface.
pub fn alpha_of(psi: f64) -> f64 {
    match psi {
        psi if psi > 0.0 => 1.0,
        psi if psi < 0.0 => 0.0,
        _ => 0.5,
    }
}

/// α of a disc, 2α - 1 = w/|w|, and its middle where w = 0.
pub fn alphas_of(w: [f64; 2]) -> [f64; 2] {
    let size = w[0].hypot(w[1]);
    w.map(|w| 0.5 + 0.5 * if size > 0.0 { w / size } else { 0.0 })
}

/// A point, with the numbers that hold there.
#[derive(Clone, Copy)]
pub(crate) struct Point<'p> {
    pub t: f64,
    pub x: &'p [f64],
    pub numbers: &'p [f64],
}

impl Point<'_> {
    /// With α or z behind x.
    pub fn with(&self, more: &[f64]) -> Vec<f64> {
        [&[self.t], self.x, more, self.numbers].concat()
    }

    /// z where a run starts; zero where a rule has no value.
    pub fn start(self, system: &ComplementaritySystem) -> Vec<f64> {
        let mut z = system.z_at(self, &[]);
        let without = z.iter_mut().filter(|z| !z.is_finite());
        without.for_each(|z| *z = 0.0);
        z
    }

    /// z at (t, x) in the mode of these α, which need not be those of the point.
    pub fn z_in_mode(self, system: &ComplementaritySystem, alpha: &[f64]) -> Vec<f64> {
        let leading = system.surfaces.leading.iter();
        let led = leading.map(|leading| (leading.switch, alpha[leading.switch]));
        let (psi, _) = self.sides(system, &led.collect::<Vec<_>>());
        self.z_by(system, &psi, alpha)
    }

    /// z by ψ, with indicators behind them, and α.
    fn z_by(self, system: &ComplementaritySystem, psi: &[f64], alpha: &[f64]) -> Vec<f64> {
        let rules = &system.surfaces.rules;
        let mut z = rules.values(psi, alpha);
        for (i, z) in z.iter_mut().enumerate() {
            *z /= system.surfaces.units.of_z(i);
        }
        // The equation g_row = 0 of a product is 0 = z_i - product, so z_i = -g_row where z_i = 0 is put in. Outputs
        // are (f, g) with n entries of f. Products come last, and in order: the factors of each are known by then.
        let n = system.n_states();
        for (i, rule) in rules.z.iter().enumerate() {
            if let Rule::Product(row) = rule {
                z[i] = -eval(&system.full.equations, &self.with(&z))[n + row];
            }
        }
        z
    }

    /// ψ, with indicators behind them, and α; that of the switches in `led` is given.
    pub fn sides(
        self,
        system: &ComplementaritySystem,
        led: &[(usize, f64)],
    ) -> (Vec<f64>, Vec<f64>) {
        let n = system.n_switches();
        let mut alpha = vec![0.5; n];
        // Each pass finds the α of one more switch at least.
        for _ in 0..n {
            let psi = eval(&system.surfaces.psi, &self.with(&alpha));
            let mut next: Vec<f64> = psi[..n].iter().map(|&psi| alpha_of(psi)).collect();
            for &(switch, alpha) in led {
                next[switch] = alpha;
            }
            for disc in &system.discs {
                let [first, second] = disc.switches;
                [next[first], next[second]] = alphas_of(disc.switches.map(|k| psi[k]));
            }
            if next == alpha {
                return (psi, alpha);
            }
            alpha = next;
        }
        (eval(&system.surfaces.psi, &self.with(&alpha)), alpha)
    }
}

pub(crate) fn eval(tape: &Tape, inputs: &[f64]) -> Vec<f64> {
    let mut outputs = vec![0.0; tape.n_outputs()];
    tape.eval(inputs, &mut outputs, &mut tape.scratch());
    outputs
}

/// α of a side, 1/2 on the surface.
pub(crate) fn alpha_on(side: Side) -> f64 {
    0.5 + 0.5 * side.sign()
}

impl ComplementaritySystem {
    /// Which of the leading switches, those of time with which others jump, are on their surface,
    /// |ψ| ≤ `SURFACE` Σ |v ∂ψ/∂v|, with α of these sides. No ψ of theirs has another α in it: those are NaN.
    pub(crate) fn meets(&self, point: Point, sides: &[(usize, Side)]) -> Vec<bool> {
        let mut alpha = vec![f64::NAN; self.n_switches()];
        for &(switch, side) in sides {
            alpha[switch] = alpha_on(side);
        }
        let inputs = point.with(&alpha);
        let is_on_surface = |leading: &Leading| {
            let values = eval(&leading.terms, &inputs);
            let (psi, terms) = (values[0], &values[1..]);
            let size: f64 = terms.iter().map(|term| term.abs()).sum();
            psi.abs() <= SURFACE * size.max(f64::MIN_POSITIVE)
        };
        self.surfaces.leading.iter().map(is_on_surface).collect()
    }

    /// z at (t, x), by its rules from ψ and α: off all surfaces the solution of the linear programs, on a surface the
    /// middle, α = 1/2. Switches of time that are in `led` have the given side instead.
    pub(crate) fn z_at(&self, point: Point, led: &[(usize, Side)]) -> Vec<f64> {
        let led: Vec<(usize, f64)> = led.iter().map(|&(k, side)| (k, alpha_on(side))).collect();
        let (psi, alpha) = point.sides(self, &led);
        point.z_by(self, &psi, &alpha)
    }

    /// ψ of all switches for their α, with indicators behind them.
    pub(crate) fn psi_at(&self, point: Point, alpha: &[f64]) -> Vec<f64> {
        eval(&self.surfaces.psi, &point.with(alpha))
    }

    /// The switch of a gap that is negative at a point by more than rounding, where no solution is.
    pub(crate) fn below(&self, point: Point) -> Option<usize> {
        let mut gaps = self.surfaces.gaps.iter().copied();
        if gaps.len() == 0 {
            return None;
        }
        let psi = eval(
            &self.surfaces.psi,
            &point.with(&vec![f64::NAN; self.n_switches()]),
        );
        let rules = &self.surfaces.rules.z;
        let unit = |gap: usize| {
            let z = rules.iter().position(|rule| *rule == Rule::Above(gap));
            z.map_or(1.0, |z| self.surfaces.units.of_z(z))
        };
        gaps.find(|&k| psi[k] < -OUTSIDE * unit(k))
    }
}
