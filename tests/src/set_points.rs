//! Random loops whose set points step: as text, and with their solution by matrix exponentials.
//!
//! x_i' = Σ_j a_ij x_j + b_i + u_i,   u_i = k_i sign(e_i), sat(g_i e_i, -m_i, m_i) or sat(g_i e_i + h_i w_i, -m_i, m_i),
//! e_i = r_i(t) - x_i,   w_i' = e_i
//!
//! Between steps r is constant and the system is one of [`crate::affine`], which goes on from where the piece before
//! ended: nothing else of the past is left but the states.

use std::fmt::Write;

use nalgebra::{DMatrix, DVector};

use crate::affine::exact::{End, solve};
use crate::affine::{Affine, Form, Kind, Surface};
use crate::random::Random;

/// How a set point is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Written {
    /// `if time < t1 then r0 else ..`
    Cases,
    /// `r0 + d1*step(time - t1) + ..`
    Steps,
    /// A table with `fit = hold`.
    Table,
    /// An input, by cases.
    Input,
}

/// How a loop acts.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Law {
    /// k sign(e)
    Relay(f64),
    /// sat(g e, -m, m)
    Saturated(f64, f64),
    /// sat(g e + h w, -m, m), w' = e
    Integral(f64, f64, f64),
}

/// A set point: its first value, and when it has which other ones.
#[derive(Clone, Debug)]
struct SetPoint {
    first: f64,
    steps: Vec<(f64, f64)>,
    written: Written,
}

/// Loops, and where they end.
#[derive(Clone, Debug)]
pub struct Loops {
    /// The body of the model, with a control U that has nothing to do.
    pub model: String,
    /// `set_points.csv`; empty where there is no table.
    pub data: String,
    /// What stands in `with`; empty where nothing is an input.
    pub given: String,
    /// Last instant.
    pub horizon: f64,
    /// x at the end.
    pub end: Vec<f64>,
    /// The largest magnitude that each has had.
    pub scales: Vec<f64>,
}

impl SetPoint {
    fn at(&self, t: f64) -> f64 {
        let mut passed = self.steps.iter().filter(|(time, _)| *time <= t);
        passed.next_back().map_or(self.first, |(_, value)| *value)
    }

    fn cases(&self) -> String {
        let mut text = String::new();
        let mut value = self.first;
        for (time, next) in &self.steps {
            write!(text, "if time < {time:?} then {value:?} else ").expect("a string takes it");
            value = *next;
        }
        write!(text, "{value:?}").expect("a string takes it");
        text
    }

    fn steps(&self) -> String {
        let mut text = format!("{:?}", self.first);
        let mut value = self.first;
        for (time, next) in &self.steps {
            let by = next - value;
            write!(text, " + ({by:?})*step(time - {time:?})").expect("a string takes it");
            value = *next;
        }
        text
    }
}

/// Loops of a seed: those after it where a solution is not unique or an event too flat for the exponentials.
pub fn loops(seed: u64, written: Written) -> Loops {
    let mut seed = seed.wrapping_mul(1_000_003);
    loop {
        if let Some(found) = generate(seed, written) {
            return found;
        }
        seed += 1;
    }
}

fn generate(seed: u64, written: Written) -> Option<Loops> {
    let mut random = Random(seed);
    let m = 1 + random.below(3);
    let horizon = 3.0;
    let laws: Vec<Law> = (0..m).map(|_| law(&mut random)).collect();
    let points: Vec<SetPoint> = (0..m)
        .map(|_| set_point(&mut random, horizon, written))
        .collect();
    let n = m + laws
        .iter()
        .filter(|law| matches!(law, Law::Integral(..)))
        .count();
    let couple = DMatrix::from_fn(m, m, |i, j| match i == j {
        true => -0.25 * random.below(4) as f64,
        false => 0.25 * random.dyadic(),
    });
    let offset: Vec<f64> = (0..m).map(|_| 0.25 * random.dyadic()).collect();
    let start: Vec<f64> = (0..m).map(|_| random.dyadic()).collect();

    let mut instants: Vec<f64> = points
        .iter()
        .flat_map(|p| p.steps.iter().map(|s| s.0))
        .collect();
    instants.push(horizon);
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    let mut x = DVector::zeros(n);
    x.rows_mut(0, m).copy_from_slice(&start);
    let (mut t, mut scales) = (0.0, x.abs());
    for until in instants {
        let now: Vec<f64> = points.iter().map(|point| point.at(t)).collect();
        let piece = affine(&laws, (&couple, &offset), &now, &x, until - t);
        let solution = solve(&piece);
        if solution.end != End::Horizon {
            return None;
        }
        for k in 0..=50 {
            scales = scales.sup(&solution.state((until - t) * f64::from(k) / 50.0).abs());
        }
        x = solution.state(until - t);
        t = until;
    }
    let (model, given) = text(&laws, &points, (&couple, &offset), &start);
    Some(Loops {
        model,
        data: table(&points, written),
        given,
        horizon,
        end: x.iter().copied().collect(),
        scales: scales.iter().map(|scale| scale.max(1e-3)).collect(),
    })
}

fn law(random: &mut Random) -> Law {
    let strength = 1.0 + random.below(5) as f64 * 0.25;
    match random.below(3) {
        0 => Law::Relay(strength),
        1 => Law::Saturated(2.0 + random.below(5) as f64, strength),
        _ => Law::Integral(
            2.0 + random.below(4) as f64,
            1.0 + random.below(3) as f64,
            strength,
        ),
    }
}

fn set_point(random: &mut Random, horizon: f64, written: Written) -> SetPoint {
    let count = 1 + random.below(3);
    // Several set points may step at once.
    let mut times: Vec<f64> = (0..count)
        .map(|_| (1 + random.below(11)) as f64 * horizon / 12.0)
        .collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let value = |random: &mut Random| random.below(9) as f64 * 0.25 - 1.0;
    let first = value(random);
    let steps = times.into_iter().map(|time| (time, value(random)));
    let mut last = first;
    let mut steps: Vec<(f64, f64)> = steps.collect();
    steps.retain(|(_, value)| std::mem::replace(&mut last, *value) != *value);
    SetPoint {
        first,
        steps,
        written,
    }
}

/// The system while set points are these.
fn affine(
    laws: &[Law],
    (couple, offset): (&DMatrix<f64>, &[f64]),
    now: &[f64],
    start: &DVector<f64>,
    horizon: f64,
) -> Affine {
    let (m, n) = (laws.len(), start.len());
    let mut field = DMatrix::zeros(n, n + 2);
    field.view_mut((0, 0), (m, m)).copy_from(couple);
    let mut surfaces = Vec::new();
    let mut integral = m;
    for (i, law) in laws.iter().enumerate() {
        field[(i, n)] = offset[i];
        let mut error = DVector::zeros(n + 2);
        (error[i], error[n]) = (-1.0, now[i]);
        let mut clip = |u: DVector<f64>, limit: f64| {
            // sat(u) = |u + m|/2 - |u - m|/2
            for (sign, by) in [(1.0, limit), (-1.0, -limit)] {
                let mut normal = u.clone();
                normal[n] += by;
                let mut jump = DMatrix::zeros(n, n + 2);
                jump.row_mut(i)
                    .copy_from(&(0.5 * sign * normal.transpose()));
                surfaces.push(Surface {
                    normal,
                    jump,
                    kind: Kind::Kink,
                });
            }
        };
        match *law {
            Law::Relay(k) => {
                let mut jump = DMatrix::zeros(n, n + 2);
                jump[(i, n)] = k;
                surfaces.push(Surface {
                    normal: error,
                    jump,
                    kind: Kind::Jump,
                });
            }
            Law::Saturated(g, limit) => clip(g * error, limit),
            Law::Integral(g, h, limit) => {
                field.row_mut(integral).copy_from(&error.transpose());
                let mut u = g * error;
                u[integral] += h;
                clip(u, limit);
                integral += 1;
            }
        }
    }
    Affine {
        n,
        field,
        surfaces,
        start: start.clone(),
        horizon,
        form: Form::Terms,
    }
}

/// The model, and what its experiment gives.
fn text(
    laws: &[Law],
    points: &[SetPoint],
    (couple, offset): (&DMatrix<f64>, &[f64]),
    start: &[f64],
) -> (String, String) {
    let (mut text, mut given) = (String::from("control U in [-1, 1] = 0;\n"), String::new());
    let mut line = |words: String| writeln!(text, "{words}").expect("a string takes it");
    let mut integral = laws.len();
    for (i, (law, point)) in laws.iter().zip(points).enumerate() {
        let k = i + 1;
        match point.written {
            Written::Cases => line(format!("let r{k} = {};", point.cases())),
            Written::Steps => line(format!("let r{k} = {};", point.steps())),
            Written::Table => line(format!(
                "signal r{k} = table(\"set_points.csv\", \"r{k}\", fit = hold);"
            )),
            Written::Input => {
                line(format!("input r{k};"));
                write!(given, "r{k} = {}; ", point.cases()).expect("a string takes it");
            }
        }
        line(format!("state x{k} = {:?};", start[i]));
        let coupled = (0..laws.len()).map(|j| format!("({:?})*x{}", couple[(i, j)], j + 1));
        let coupled = coupled.collect::<Vec<_>>().join(" + ");
        let acts = match *law {
            Law::Relay(strength) => format!("{strength:?}*sign(r{k} - x{k})"),
            Law::Saturated(g, limit) => format!("sat({g:?}*(r{k} - x{k}), -{limit:?}, {limit:?})"),
            Law::Integral(g, h, limit) => {
                integral += 1;
                line(format!(
                    "state x{integral} = 0;\nx{integral}' = r{k} - x{k};"
                ));
                format!("sat({g:?}*(r{k} - x{k}) + {h:?}*x{integral}, -{limit:?}, {limit:?})")
            }
        };
        line(format!("x{k}' = {coupled} + ({:?}) + {acts};", offset[i]));
    }
    (text, given)
}

/// All set points at all instants at which one steps.
fn table(points: &[SetPoint], written: Written) -> String {
    if written != Written::Table {
        return String::new();
    }
    let mut times: Vec<f64> = points
        .iter()
        .flat_map(|p| p.steps.iter().map(|s| s.0))
        .collect();
    times.push(0.0);
    times.sort_by(f64::total_cmp);
    times.dedup();
    let names: Vec<String> = (1..=points.len()).map(|k| format!("r{k}")).collect();
    let mut text = format!("time,{}\n", names.join(","));
    for time in times {
        let values: Vec<String> = points.iter().map(|p| format!("{:?}", p.at(time))).collect();
        writeln!(text, "{time:?},{}", values.join(",")).expect("a string takes it");
    }
    text
}
