//! Optimizations whose free parameters reach the problem through others, against differences of simulations.
//!
//! Two parameters p and s are free. A chain of parameters leads from them to one place: a rate, a part, an initial
//! value, `with`, a vector, a matrix, the bound of a control, or the horizon. The model is then simulated with the
//! numbers that were found, and with others beside them: the objective is the same, and nowhere smaller.

use nsdc::diagnostics::Diagnostics;
use nsdc::expr::Exprs;
use nsdc::project::clock::Clock;
use nsdc::report::Status;
use nsdc::simulate::Request;
use nsdc::source::SourceMap;
use nsdc::syntax::{self, Item};
use nsdc::{compile, optimize};

use super::Extent;
use crate::random::Random;
use crate::{end, solved};

/// Where the chain of parameters ends.
const PLACES: [&str; 8] = [
    "rate", "part", "initial", "with", "vector", "matrix", "bound", "horizon",
];
/// Ranges of p and s.
const RANGES: [[f64; 2]; 2] = [[0.4, 2.0], [0.3, 1.5]];
/// How far beside the optimum simulations are.
const BESIDE: f64 = 1e-2;
/// What objectives may differ by, relative to 1 + |J|.
const SAME: f64 = 1e-6;

/// One optimization.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The number of the instance, and where p and s are read.
    pub name: String,
    model: String,
    settings: String,
    /// How it is simulated with given numbers.
    horizon: String,
    with: String,
    target: f64,
    weights: [f64; 2],
    centres: [f64; 2],
}

/// Some instances, or all 240.
pub fn instances(extent: Extent) -> Vec<Instance> {
    let count = extent.of(2 * PLACES.len(), 30 * PLACES.len());
    (0..count).map(instance).collect()
}

fn instance(number: usize) -> Instance {
    let place = PLACES[number % PLACES.len()];
    let mut random = Random(25 + number as u64);
    let mut numbers = [[0.0; 2]; 2];
    for (range, row) in RANGES.iter().zip(&mut numbers) {
        *row = [0; 2].map(|_| random.rounded(range[0], range[1]));
    }
    let [[p, centre_p], [s, centre_s]] = numbers;
    let (r, chain) = chain(&mut random);
    let c = random.rounded(0.2, 0.8);
    let (body, with) = body(place, &r, c);
    let horizon = match place {
        "horizon" => r.as_str(),
        _ => "1",
    };
    let decay = "model decay { param k = 1; state z = 1; z' = -k*z; }\n";
    let model = format!(
        "{decay}model m {{ param p in [0.4, 2] = {p:?}; param s in [0.3, 1.5] = {s:?}; {chain} {body} }}\n"
    );
    // A control at its bound: the target is beyond what it reaches.
    let target = match place {
        "bound" => 9.0,
        _ => random.rounded(0.1, 1.5),
    };
    let pushes = if place == "bound" {
        format!("u = {r};")
    } else {
        String::new()
    };
    let weights = [0; 2].map(|_| random.rounded(0.02, 0.5));
    let cost = format!(
        "final((y - {target:?})^2) + {:?}*(p - {centre_p:?})^2 + {:?}*(s - {centre_s:?})^2",
        weights[0], weights[1]
    );
    Instance {
        name: format!("{number}, {place}"),
        model,
        settings: format!(
            "horizon {horizon}; intervals 3; elements 2; scheme radau_iia(5); free {{ p; s; }} with {{ {with} }} \
             minimize {cost};"
        ),
        horizon: horizon.to_owned(),
        with: format!("{with} {pushes}"),
        target,
        weights,
        centres: [centre_p, centre_s],
    }
}

/// The last of r1 = a p + b s, r2 of r1, .., which is positive, and the lines of all.
fn chain(random: &mut Random) -> (String, String) {
    let mut chain = format!(
        "param r1 = {:?}*p + {:?}*s;",
        random.rounded(0.2, 1.0),
        random.rounded(0.0, 0.6)
    );
    let length = 1 + random.below(4);
    for k in 2..=length {
        let before = k - 1;
        let value = match random.below(4) {
            0 => format!("{:?} + 0.5*r{before}", random.rounded(0.0, 0.5)),
            1 => format!("sqrt(r{before} + 0.1*p)"),
            2 => format!("r{before}*(0.6 + 0.2*s)"),
            _ => format!("1.2*r{before}/(1 + 0.3*r{before}^2)"),
        };
        chain += &format!(" param r{k} = {value};");
    }
    (format!("r{length}"), chain)
}

/// The lines of a model in which y depends on r in a place of its own, and what its experiment sets.
fn body(place: &str, r: &str, c: f64) -> (String, String) {
    let body = match place {
        "rate" => format!("state y = 1; y' = -{r}*y + {c:?}*s;"),
        "part" => {
            format!("part a = decay {{ k = {r}; z = {r}; }} state y = 1; y' = a.z - {c:?}*y;")
        }
        "initial" => format!("state y = {r}; y' = -{c:?}*y;"),
        "with" => format!("state y = 3; y' = -{c:?}*y + s;"),
        "vector" => format!(
            "param v[2] = [{r}, p*s]; state x[2] = v; state y = 0; x' = -v .* x; y' = x[1] - x[2];"
        ),
        "matrix" => format!(
            "param A[2,2] = [{r}, {c:?}; -{c:?}, p]; state x[2] = [1, A[1,1]]; state y = 0; x' = -A*x; \
             y' = x[1] + x[2];"
        ),
        "bound" => {
            format!("control u in [-{r}, {r}] = 0; state y = 0; y' = u - {c:?}*y;")
        }
        _ => format!("state y = 1; y' = -{c:?}*y + s;"),
    };
    let with = match place {
        "with" => format!("y = {r}^2;"),
        _ => String::new(),
    };
    (body, with)
}

impl Instance {
    /// The optimization, `best`.
    pub fn text(&self) -> String {
        format!("{}optimize best of m {{ {} }}\n", self.model, self.settings)
    }

    /// J(p, s) by a simulation.
    fn simulated(&self, [p, s]: [f64; 2]) -> f64 {
        let text = format!(
            "{}simulate run of m {{ horizon {}; tolerance 1e-10; with {{ p = {p:?}; s = {s:?}; {} }} }}\n",
            self.model, self.horizon, self.with
        );
        let y = end(&solved(&text, "run"), "y")[0];
        let shares = self.weights.iter().zip(&self.centres).zip([p, s]);
        let rest = shares.map(|((weight, centre), value)| weight * (value - centre).powi(2));
        (y - self.target).powi(2) + rest.sum::<f64>()
    }

    /// The objective, and p and s.
    fn optimized(&self) -> Result<(f64, [f64; 2]), String> {
        let mut diags = Diagnostics::new();
        let file = syntax::parse(&SourceMap::new().add("test.nsd", self.text()), &mut diags);
        let Some(Item::Experiment(experiment)) = file.items.last() else {
            return Err("no experiment".to_owned());
        };
        let (exprs, mut clock) = (Exprs::new(), Clock::default());
        let compiled = compile(&exprs, &file, experiment, &[], &mut clock, &mut diags);
        let compiled = compiled.ok_or_else(|| format!("{:?}", diags.codes()))?;
        let (system, settings) = (&compiled.system, &compiled.settings);
        let task = settings.optimize.as_ref().ok_or("no optimization")?;
        let found = optimize::run(system, settings, task, &[], &Request::default(), &mut ());
        let found = found.map_err(|error| error.to_string())?;
        if found.trajectory.status != Status::Solved {
            return Err(format!("{:?}", found.trajectory.failure));
        }
        let value = |name: &str| {
            let param = found.system.exogenous.named(name);
            param.map_or(f64::NAN, |param| param.value)
        };
        let objective = found.trajectory.objective.unwrap_or(f64::NAN);
        Ok((objective, [value("p"), value("s")]))
    }

    /// What is wrong with the optimum, where something is.
    pub fn judge(&self) -> Result<(), String> {
        let (objective, point) = self.optimized()?;
        let here = self.simulated(point);
        let size = 1.0 + here.abs();
        let differ = (objective - here).abs();
        if differ.is_nan() || differ > SAME * size {
            return Err(format!(
                "objective {objective}, simulated {here} at {point:?}"
            ));
        }
        for (k, range) in RANGES.iter().enumerate() {
            for step in [-BESIDE, BESIDE] {
                let mut other = point;
                other[k] = (point[k] + step).clamp(range[0], range[1]);
                let there = self.simulated(other);
                if there < here - SAME * size {
                    return Err(format!("{here} at {point:?}, and {there} at {other:?}"));
                }
            }
        }
        Ok(())
    }
}
