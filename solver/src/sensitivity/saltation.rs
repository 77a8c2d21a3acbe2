//! What an event does to tangents.

use super::Why;
use super::forward::Run;
use super::functions::{Functions, Linearized, Moved, Point};
use super::jump::{Jumped, jumped};
use super::recording::{Jump, Step};
use crate::hybrid::{Guard, Role, Side};
use crate::linalg::DenseLu;

/// A rate is none below this part of how large its terms have been.
const TANGENTIAL: f64 = 1e-7;
/// ψ is zero up to this part of its terms.
const ON: f64 = 1e-11;
/// What stays on a surface does so up to this part of its terms.
const STAYS: f64 = 1e-6;
/// What is left of a tangent at least, in what its errors are a part of.
const FADED: f64 = 1e-3;
/// What is left of it by rounding.
const ROUNDED: f64 = 1e-8;
/// α is at a bound up to this.
const AT_BOUND: f64 = 1e-9;

/// A function of time, states and parameters to first order.
#[derive(Clone, Debug)]
pub(super) struct Slope {
    pub time: f64,
    pub x: Vec<f64>,
    /// By direction.
    pub by: Vec<f64>,
}

impl Slope {
    /// Of derivatives by slots.
    pub fn of(functions: &Functions, slopes: &[(usize, f64)]) -> Self {
        let n = functions.slots.n_states;
        let (mut time, mut x) = (0.0, vec![0.0; n]);
        for &(slot, slope) in slopes {
            match slot {
                0 => time += slope,
                slot if slot <= n => x[slot - 1] += slope,
                _ => {}
            }
        }
        let rest = vec![0.0; n];
        let still = Moved::still(&rest);
        let by = (0..functions.n_directions()).map(|d| functions.along(slopes, still, d)[0]);
        Slope {
            time,
            by: by.collect(),
            x,
        }
    }

    /// Of a row over t, states and directions.
    pub fn row(row: &[f64], n: usize) -> Self {
        Slope {
            time: row[0],
            x: row[1..=n].to_vec(),
            by: row[1 + n..].to_vec(),
        }
    }

    /// Its derivative in a direction, with the size of its terms.
    pub fn along(&self, moved: Moved, direction: usize) -> [f64; 2] {
        let terms = |x: &[f64]| -> Vec<f64> {
            let states = self.x.iter().zip(x).map(|(a, b)| a * b);
            states
                .chain([self.time * moved.time, self.by[direction]])
                .collect()
        };
        let sizes = terms(moved.size).into_iter().map(f64::abs);
        [terms(moved.x).iter().sum(), sizes.sum()]
    }

    /// Whether one is a multiple of the other.
    fn is_multiple(&self, other: &Slope) -> bool {
        let all = |slope: &Slope| [&[slope.time], &slope.x[..], &slope.by].concat();
        let (a, b) = (all(self), all(other));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
        aa * bb - ab * ab <= 1e-12 * aa * bb
    }
}

/// A point in a mode.
#[derive(Clone, Copy)]
pub(super) struct Meeting<'a> {
    pub point: Point<'a>,
    pub sides: &'a [Side],
}

impl Meeting<'_> {
    /// A switch on whose surface the point is, and does not stay as it moves in a direction; those on one side of their
    /// surface alone that are `met` are known to be on it.
    pub fn leaves(
        &self,
        functions: &mut Functions,
        sizes: &[f64],
        met: &[usize],
        moved: Moved,
        direction: usize,
    ) -> Option<usize> {
        let system = functions.system.clone();
        let guards = |i: usize| {
            system.laws.iter().any(|law| match &law.guard {
                Guard::Sides { switches, .. } => switches.contains(&i),
                Guard::Strikes(switch) => *switch == i,
            })
        };
        (0..self.sides.len()).find(|&i| {
            let switch = &system.switches[i];
            let bends = switch.is_continuous && system.role(i) == Role::Step && !guards(i);
            if bends || system.is_idle(i, self.sides) {
                return false;
            }
            let slides = self.sides[i] == Side::Slide;
            let orders = if slides {
                functions.n_derivatives(i)
            } else {
                0
            };
            (0..=orders).any(|order| {
                let psi = functions.psi(i, order, self.sides);
                let slopes = psi.slopes(&self.point, &mut functions.registers);
                let value = psi.value(&self.point, &mut functions.registers);
                let terms = slopes.iter().map(|&(slot, slope)| match slot {
                    0 => (slope * self.point.t).abs(),
                    slot if slot <= sizes.len() => slope.abs() * sizes[slot - 1],
                    _ => 0.0,
                });
                let is_on = slides || value.abs() <= ON * terms.sum::<f64>() || value == 0.0;
                let [sum, size] = functions.along(&slopes, moved, direction);
                (is_on || met.contains(&i)) && sum.abs() > STAYS * size
            })
        })
    }

    /// Gives algebraic states z the tangent that what keeps them wants: h_z Z = -(h_y Y + h_t dt/dp + h_p).
    pub fn keep_algebraic(
        &self,
        functions: &mut Functions,
        tangent: &mut [f64],
        time: f64,
        direction: usize,
    ) -> Result<(), Why> {
        let system = functions.system.clone();
        let n = system.algebraics.len();
        if n == 0 {
            return Ok(());
        }
        let kept = |&i: &usize| self.sides[i] == Side::Slide && system.role(i) != Role::Step;
        let rows = (0..self.sides.len()).filter(kept).map(|i| {
            let psi = functions.psi(i, functions.n_derivatives(i), self.sides);
            psi.slopes(&self.point, &mut functions.registers)
        });
        let rows: Vec<Vec<(usize, f64)>> = rows.collect();
        if rows.len() != n {
            return Err(Why::Singular);
        }
        let place = |slot: usize| system.algebraics.binary_search(&slot.checked_sub(1)?).ok();
        let mut matrix = vec![0.0; n * n];
        for (row, slopes) in rows.iter().enumerate() {
            for &(slot, slope) in slopes {
                if let Some(column) = place(slot) {
                    matrix[row * n + column] += slope;
                }
            }
        }
        let mut lu = DenseLu::new(n);
        lu.factor(&matrix).map_err(|_| Why::Singular)?;
        system.algebraics.iter().for_each(|&z| tangent[z] = 0.0);
        let moved = Moved {
            time,
            ..Moved::still(tangent)
        };
        let rhs = rows
            .iter()
            .map(|row| -functions.along(row, moved, direction)[0]);
        let mut rhs: Vec<f64> = rhs.collect();
        lu.solve(&mut rhs);
        for (&z, value) in system.algebraics.iter().zip(rhs) {
            tangent[z] = value;
        }
        Ok(())
    }

    /// A switch whose α is at a bound, and moves away from it in a direction.
    fn loosens(
        &self,
        functions: &Functions,
        linear: &Linearized,
        but: Option<usize>,
        moved: Moved,
        direction: usize,
    ) -> Option<usize> {
        let (system, n) = (&functions.system, functions.slots.n_states);
        (0..self.sides.len()).find(|&i| {
            let limits = system.switches[i].limits();
            let is_at = limits
                .iter()
                .any(|limit| (self.point.alpha[i] - limit).abs() <= AT_BOUND);
            if self.sides[i] != Side::Slide || !is_at || but == Some(i) {
                return false;
            }
            let [sum, size] = Slope::row(&linear.rows[n + i], n).along(moved, direction);
            sum.abs() > STAYS * size
        })
    }
}

/// An event of a run.
pub(super) struct Saltation<'a> {
    pub run: &'a Run<'a>,
    pub event: &'a Jump,
    /// The steps before and behind it, in its modes.
    pub last: Option<&'a Step>,
    pub next: Option<&'a Step>,
    /// How large states and their rates have been.
    pub sizes: &'a [f64],
    pub speeds: &'a [f64],
    /// Coefficients of data before and behind it.
    pub coefficients: [&'a [f64]; 2],
    pub is_start: bool,
}

/// An event with what is the same in all directions.
pub(super) struct Prepared<'a> {
    of: &'a Saltation<'a>,
    alpha: [Vec<f64>; 2],
    before: Linearized,
    after: Linearized,
    /// What is zero when it takes place, with its rate, and the switch; none where the instant is known.
    trigger: Option<(Slope, f64, usize)>,
    jumps: Vec<Jumped>,
}

/// Why there is no derivative, and the switches that it is about.
type Failed = (Why, Vec<usize>);

impl<'a> Saltation<'a> {
    /// A point before or behind the event.
    fn point<'p>(&'p self, behind: bool, alpha: &'p [f64]) -> Point<'p> {
        let event = self.event;
        Point {
            t: event.time,
            x: if behind { &event.after } else { &event.before },
            alpha,
            coefficients: self.coefficients[usize::from(behind)],
            parameters: self.run.parameters,
        }
    }

    fn sides(&self, behind: bool) -> &[Side] {
        if behind {
            &self.event.to
        } else {
            &self.event.from
        }
    }

    /// α on one side of the event, and the functions there.
    fn linearize(
        &self,
        functions: &mut Functions,
        behind: bool,
    ) -> Result<(Vec<f64>, Linearized), Why> {
        let sides = self.sides(behind);
        let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
        match (behind, self.last, self.next) {
            (false, Some(step), _) => step.alpha(step.length, &mut alpha),
            (true, _, Some(step)) => step.alpha(0.0, &mut alpha),
            _ => {}
        }
        let mode = functions.mode(sides);
        let start = alpha.clone();
        let point = self.point(behind, &start);
        let solved = functions.solve_alpha(&mode, &point, &mut alpha);
        let linear = solved.and_then(|()| functions.linearize(&mode, &self.point(behind, &alpha)));
        let linear = linear.map_err(|_| Why::Singular)?;
        Ok((alpha, linear))
    }

    /// What is the same in all directions.
    pub fn prepare(&'a self, functions: &mut Functions) -> Result<Prepared<'a>, Failed> {
        let event = self.event;
        let all = |why: Why| (why, event.met.clone());
        if event.accumulates {
            return Err(all(Why::Accumulation));
        }
        if event.folds {
            return Err(all(Why::Fold));
        }
        let (alpha, before) = self.linearize(functions, false).map_err(all)?;
        let (behind, after) = self.linearize(functions, true).map_err(all)?;
        let trigger = match event.is_scheduled {
            true => None,
            false => Some(self.trigger(functions, &before, &alpha)?),
        };
        let point = self.point(false, &alpha);
        let jumps = match event.laws.is_empty() {
            true => Vec::new(),
            false => jumped(functions, point, event, self.sizes).map_err(all)?,
        };
        Ok(Prepared {
            of: self,
            alpha: [alpha, behind],
            before,
            after,
            trigger,
            jumps,
        })
    }

    /// What decides when it takes place: of all that is met, what changes fastest.
    fn trigger(
        &self,
        functions: &mut Functions,
        before: &Linearized,
        alpha: &[f64],
    ) -> Result<(Slope, f64, usize), Failed> {
        let (event, system) = (self.event, functions.system.clone());
        let n = functions.slots.n_states;
        let mut found: Vec<(f64, Slope, f64, usize)> = Vec::new();
        for &i in &event.met {
            if system.is_idle(i, &event.from) {
                continue;
            }
            let slope = match event.from[i] {
                Side::Slide if system.switches[i].limits().is_empty() => continue,
                Side::Slide => Slope::row(&before.rows[n + i], n),
                _ => {
                    let psi = functions.psi(i, 0, &event.from);
                    let slopes = psi.slopes(&self.point(false, alpha), &mut functions.registers);
                    Slope::of(functions, &slopes)
                }
            };
            let terms = slope.x.iter().zip(&before.f).map(|(a, f)| a * f);
            let rate = terms.sum::<f64>() + slope.time;
            let sizes = slope.x.iter().zip(self.speeds).map(|(a, f)| (a * f).abs());
            let size = sizes.sum::<f64>() + slope.time.abs();
            found.push((rate.abs() / size, slope, rate, i));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let met = || event.met.clone();
        let Some((share, slope, rate, i)) = found.first().cloned() else {
            return Err((Why::Unknown, met()));
        };
        if share.is_nan() || share <= TANGENTIAL {
            return Err((Why::Grazing, vec![i]));
        }
        // Laws of which one is met just before the other may make another state together.
        if !event.laws.is_empty() && !found.iter().all(|other| slope.is_multiple(&other.1)) {
            return Err((Why::Several, met()));
        }
        Ok((slope, rate, i))
    }
}

fn moved<'x>(x: &'x [f64], size: &'x [f64], time: f64) -> Moved<'x> {
    Moved { x, size, time }
}

impl Prepared<'_> {
    /// dt/dp and the tangent behind the event, from that before it, how large it has been, and what it was made of.
    pub fn cross(
        &self,
        functions: &mut Functions,
        [tangent, largest, terms]: [&[f64]; 3],
        direction: usize,
    ) -> Result<(f64, Vec<f64>), Failed> {
        let of = self.of;
        let time = match &self.trigger {
            None => 0.0,
            Some((slope, rate, _)) => {
                let still = Moved::still(tangent);
                -slope.along(still, direction)[0] / rate
            }
        };
        let mut x: Vec<f64> = (tangent.iter().zip(&self.before.f))
            .map(|(s, f)| s + f * time)
            .collect();
        let mut size = self.sizes([tangent, largest, terms], time);
        let but = self.trigger.as_ref().map(|(.., switch)| *switch);
        self.check(functions, false, (moved(&x, &size, time), direction), but)?;
        for jump in &self.jumps {
            (x, size) = jump.apply(moved(&x, &size, time), direction);
        }
        let meeting = Meeting {
            point: of.point(true, &self.alpha[1]),
            sides: of.sides(true),
        };
        let kept = meeting.keep_algebraic(functions, &mut x, time, direction);
        kept.map_err(|why| (why, of.event.met.clone()))?;
        let sizes = x.iter().zip(&size).map(|(x, size)| x.abs().max(*size));
        let size: Vec<f64> = sizes.collect();
        self.check(functions, true, (moved(&x, &size, time), direction), None)?;
        let slipped = x.iter().zip(&self.after.f).map(|(x, f)| x - f * time);
        let slipped: Vec<f64> = slipped.collect();
        match slipped.iter().all(|s| s.is_finite()) {
            true => Ok((time, slipped)),
            false => Err((Why::Unknown, of.event.met.clone())),
        }
    }

    /// How large the terms are that the motion of a state is made of: where they cancel, errors are a part of how large
    /// they have been.
    fn sizes(&self, [tangent, largest, terms]: [&[f64]; 3], time: f64) -> Vec<f64> {
        let size = |i: usize| {
            let now = tangent[i].abs() + (self.before.f[i] * time).abs();
            let was = largest[i] + self.of.speeds[i] * time.abs();
            now + FADED * was + ROUNDED * terms[i]
        };
        (0..tangent.len()).map(size).collect()
    }

    /// What lies on surfaces and at bounds stays there to first order.
    fn check(
        &self,
        functions: &mut Functions,
        behind: bool,
        (moved, direction): (Moved, usize),
        but: Option<usize>,
    ) -> Result<(), Failed> {
        let of = self.of;
        let alpha = &self.alpha[usize::from(behind)];
        let linear = if behind { &self.after } else { &self.before };
        let meeting = Meeting {
            point: of.point(behind, alpha),
            sides: of.sides(behind),
        };
        let met: &[usize] = if behind { &[] } else { &of.event.met };
        let plain = |i: &usize| of.event.from[*i] != Side::Slide;
        let met: Vec<usize> = met.iter().copied().filter(plain).collect();
        let leaves = meeting.leaves(functions, of.sizes, &met, moved, direction);
        let loosens = meeting.loosens(functions, linear, but, moved, direction);
        match leaves.or(loosens) {
            Some(switch) if of.is_start => Err((Why::Start, vec![switch])),
            Some(switch) => Err((Why::Several, vec![switch])),
            None => Ok(()),
        }
    }
}
