//! Optimal control with switches near ends of intervals: certificates against differences of simulations, and optima
//! against those of several starts.
//!
//! A simulation of the differences is one of a model in which the controls are data and parameters are numbers; the
//! objective is put together here.

use nsdc::optimize;
use nsdc::report::{Confirmation, Status, Warning};
use nsdc::simulate::Request;

use super::{Case, Extent, Family, Outcome};
use crate::random::Random;
use crate::{DataFiles, end, run_with_data, with_experiment};

/// Changes of controls, as a share of their bounds.
const STEP: f64 = 1e-5;
/// Descent per unit of a control that is none: relative to the objective, and what differences cannot tell.
const RELATIVE: f64 = 1e-3;
const ABSOLUTE: f64 = 1e-4;
/// An optimum is as good as another one that is better by no more than this share.
const AS_GOOD: f64 = 1e-2;
/// How many starts an optimum is compared with.
const STARTS: usize = 20;

/// What is nonsmooth.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Another constant on each side.
    Switch,
    /// A relay, which may be held.
    Relay,
    /// A kink in a rate.
    Kink,
    /// Dry friction.
    Friction,
    /// A surface in time, at a parameter.
    Time,
    /// A stiffness, with friction.
    Stiffness,
    Impacts,
}

/// A problem with 2 to 8 controls.
#[derive(Clone, Debug)]
pub struct Problem {
    kind: Kind,
    /// Equations, with `U` for the control and perhaps `p` for a parameter.
    body: String,
    /// Bounds of the control are plus and minus this.
    bound: f64,
    /// Its default.
    default: f64,
    /// Bounds and guess of p.
    param: Option<[f64; 3]>,
    horizon: f64,
    intervals: usize,
    /// What x is to be at the end; what v is to be is 0.
    target: f64,
    /// Of v².
    speed: f64,
    /// Of the integral of U².
    effort: f64,
    /// Lines of the experiment.
    options: &'static str,
    asks: Asks,
}

/// What is asked of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asks {
    /// No descent along a control or a parameter.
    Certificate,
    /// No start is better.
    Best,
}

/// What was decided.
struct Decided {
    controls: Vec<f64>,
    param: Option<f64>,
}

pub fn families(extent: Extent) -> Vec<Family> {
    let family = |name, about, asks, count: u64| Family {
        name,
        about,
        hardness: "kind",
        cases: (0..count)
            .map(|seed| Case::optimal(Problem::random(seed, asks)))
            .collect(),
    };
    let [certificates, optima] = extent.of([4, 0], [500, 500]);
    let mut families = vec![family(
        "certificates of optimal controls",
        "Switches, relays, kinks, friction, impacts and time as a surface, at ends of control intervals: descent per \
         unit of a control or parameter where there is more than a thousandth of the objective, by simulations.",
        Asks::Certificate,
        certificates,
    )];
    families.extend((optima > 0).then(|| {
        family(
            "optima beside those of 20 starts",
            "The same problems: by what share the best of 20 random starts is better, where that is more than 1 %.",
            Asks::Best,
            optima,
        )
    }));
    families
}

impl Problem {
    /// The problem of a seed: in half of them the default meets the surface at the end of an interval.
    fn random(seed: u64, asks: Asks) -> Self {
        let mut random = Random(seed);
        let kind = random.of(&[
            Kind::Switch,
            Kind::Relay,
            Kind::Kink,
            Kind::Friction,
            Kind::Time,
            Kind::Stiffness,
            Kind::Impacts,
        ]);
        let mut number = |from: f64, to: f64| {
            let value = from + (to - from) * 0.5 * (random.dyadic() + 1.0);
            (value * 1000.0).round() / 1000.0
        };
        let rates = [0.1, 0.2, 0.5, 0.5].map(|least| number(least, 2.0 * least + 0.5));
        let default = number(-0.9, 0.9);
        let target = number(-2.0, 2.0);
        let effort = number(0.02, 0.3);
        let speed = number(0.0, 1.0);
        let start = number(-1.0, 1.0);
        let intervals = 2 + random.below(7);
        let meets = random.below(2) == 0;
        let horizon = [1.0, 2.0, 3.0][random.below(3)];
        let instant = horizon * (1 + random.below(intervals)) as f64 / intervals as f64;
        let mut problem = Problem {
            kind,
            body: String::new(),
            bound: 1.0,
            default,
            param: None,
            horizon,
            intervals,
            target,
            speed: 0.0,
            effort,
            options: "",
            asks,
        };
        problem.state(rates, start, meets.then_some(instant));
        if problem.body.contains("state v") {
            problem.speed = speed;
        }
        problem
    }

    /// States the equations of its kind. `meets` is when the default meets the surface.
    fn state(&mut self, [a, b, c, d]: [f64; 4], start: f64, meets: Option<f64>) {
        let default = self.default;
        // The start from which this rate leads to zero.
        let from = |rate: f64| meets.map_or(start, |instant| -rate * instant);
        self.body = match self.kind {
            Kind::Switch => format!(
                "state x = {:?}; x' = U + (if x > 0 then {a:?} else -{b:?});",
                from(default - b)
            ),
            Kind::Relay => format!(
                "state x = {:?}; x' = U - {a:?}*sign(x);",
                from(default - a * start.signum())
            ),
            Kind::Kink => {
                let v0 = meets.map_or(default, |instant| -start / instant);
                format!(
                    "state x = {start:?}; state v = {v0:?}; x' = v; v' = U - {c:?}*abs(x) + {a:?}*x;"
                )
            }
            Kind::Friction => {
                self.bound = 5.0;
                let v0 = from(default - d);
                format!("state x = {start:?}; state v = {v0:?}; x' = v; v' = U - {d:?}*sign(v);")
            }
            Kind::Time => {
                let [first, last] = [0.1, 0.9].map(|share| share * self.horizon);
                let guess = meets.unwrap_or(0.4).clamp(first, last);
                self.param = Some([first, last, guess]);
                format!("state x = {start:?}; x' = U + {c:?}*abs(time - p) - {a:?}*sign(time - p);")
            }
            Kind::Stiffness => {
                self.param = Some([1.0, 9.0, 3.0 + a]);
                let x0 = 1.0 + c;
                format!("state x = {x0:?}; state v = 0; x' = v; v' = U - p*x - {d:?}*sign(v);")
            }
            Kind::Impacts => {
                self.bound = 5.0;
                self.options = "lower impact;";
                let (x0, v0, e) = (c + 0.2, -start.abs(), 0.4 + 0.5 * a);
                format!(
                    "state x = {x0:?}; state v = {v0:?}; x' = v;
                     mechanics x, v {{ mass = 1; force = U - 2; contact floor {{ gap = x; restitution = {e:?}; }} }}"
                )
            }
        };
    }

    /// The word for what is nonsmooth.
    pub fn kind(&self) -> String {
        format!("{:?}", self.kind).to_lowercase()
    }

    /// The model and its experiment.
    pub fn text(&self) -> String {
        self.with_starts("")
    }

    fn with_starts(&self, starts: &str) -> String {
        let Problem {
            body,
            bound,
            default,
            horizon,
            intervals,
            options,
            ..
        } = self;
        let param = self
            .param
            .map_or_else(String::new, |[lower, upper, guess]| {
                format!("param p in [{lower:?}, {upper:?}] = {guess:?};")
            });
        let free = if self.param.is_some() {
            "free { p; }"
        } else {
            ""
        };
        let speed = match self.speed > 0.0 {
            true => format!(" + {:?}*v^2", self.speed),
            false => String::new(),
        };
        let (target, effort) = (self.target, self.effort);
        format!(
            "model m {{ {param} control U in [-{bound:?}, {bound:?}] = {default:?}; {body} }}
             optimize run of m {{ horizon {horizon:?}; intervals {intervals}; elements 3; {options} {free} {starts}
               minimize final((x - {target:?})^2{speed}) + integral({effort:?}*U^2); }}"
        )
    }

    /// The objective of a simulation.
    fn objective(&self, decided: &Decided) -> f64 {
        let param = decided
            .param
            .map_or_else(String::new, |p| format!("param p = {p:?};"));
        let text = format!(
            "model m {{ {param} signal U = table(\"u.csv\", \"u\", fit = hold); {} }}
             simulate s of m {{ horizon {:?}; tolerance 1e-10; }}",
            self.body, self.horizon
        );
        let h = self.horizon / self.intervals as f64;
        let rows = decided.controls.iter().enumerate();
        let rows: String = rows
            .map(|(k, u)| format!("{:?},{u:?}\n", k as f64 * h))
            .collect();
        let data = DataFiles(vec![("u.csv", format!("t,u\n{rows}"))]);
        let run = run_with_data(&text, &data, "s");
        if run.status != Status::Solved {
            return f64::NAN;
        }
        let at_end = |name: &str| end(&run, name)[0];
        let speed = if self.speed > 0.0 { at_end("v") } else { 0.0 };
        let effort: f64 = decided.controls.iter().map(|u| u * u * h).sum();
        (at_end("x") - self.target).powi(2) + self.speed * speed * speed + self.effort * effort
    }

    /// The steepest descent along one of what was decided, per unit; what has no simulation is left out.
    fn descent(&self, decided: &Decided) -> f64 {
        let objective = self.objective(decided);
        let mut steepest: f64 = 0.0;
        let controls = decided.controls.len();
        for i in 0..controls + usize::from(decided.param.is_some()) {
            let [lower, upper] = match self.param {
                Some([lower, upper, _]) if i == controls => [lower, upper],
                _ => [-self.bound, self.bound],
            };
            let step = STEP * 0.5 * (upper - lower);
            for sign in [1.0, -1.0] {
                let mut moved = Decided {
                    controls: decided.controls.clone(),
                    param: decided.param,
                };
                let value = match moved.controls.get_mut(i) {
                    Some(value) => value,
                    None => moved
                        .param
                        .as_mut()
                        .expect("there is a parameter behind controls"),
                };
                *value += sign * step;
                if !(lower..=upper).contains(&*value) {
                    continue;
                }
                steepest = steepest.max((objective - self.objective(&moved)) / step);
            }
        }
        steepest
    }

    /// Solves it and looks at what was asked.
    pub fn run(&self) -> Outcome {
        let (found, decided) = self.solve(&self.text());
        let objective = found.objective.unwrap_or(f64::INFINITY);
        if found.status != Status::Solved {
            let failure = found.failure.as_ref().map(|f| Warning::of(f).code);
            return Outcome::Refused(failure.unwrap_or_default());
        }
        let error = match self.asks {
            Asks::Certificate => {
                let descent = self.descent(&decided);
                match descent > RELATIVE * objective.abs() + ABSOLUTE {
                    true => descent / objective.abs(),
                    false => 0.0,
                }
            }
            Asks::Best => {
                let starts = format!("starts {STARTS} by gauss(0.5) seed 1;");
                let (best, _) = self.solve(&self.with_starts(&starts));
                let best = best.objective.filter(|_| best.status == Status::Solved);
                let better = objective - best.unwrap_or(objective);
                match better > AS_GOOD * objective.abs() + ABSOLUTE * AS_GOOD {
                    true => better / objective.abs(),
                    false => 0.0,
                }
            }
        };
        let is_confirmed = (found.optimum.as_ref())
            .is_some_and(|optimum| optimum.confirmation == Confirmation::Confirmed);
        let mut codes: Vec<String> = found.warnings.iter().map(|one| one.code.clone()).collect();
        codes.dedup();
        match () {
            () if error == 0.0 => Outcome::Met { error },
            () if is_confirmed && codes.is_empty() => Outcome::Wrong { error },
            () => Outcome::Warned { error, codes },
        }
    }

    fn solve(&self, text: &str) -> (nsdc::report::Trajectory, Decided) {
        with_experiment(text, "run", |compiled| {
            let task = compiled
                .settings
                .optimize
                .as_ref()
                .expect("an optimization");
            let (system, settings) = (&compiled.system, &compiled.settings);
            let run = optimize::run(system, settings, task, &[], &Request::default(), &mut ());
            let found = run.expect("the problem can be discretized");
            let h = self.horizon / self.intervals as f64;
            let mut data = found.system.exogenous.data.iter();
            let control = data.find(|data| data.name == "U");
            let table = &control.expect("controls are functions of time").table;
            let param = found.system.exogenous.named("p");
            let decided = Decided {
                controls: (0..self.intervals)
                    .map(|k| table.value((k as f64 + 0.5) * h))
                    .collect(),
                param: param.map(|param| param.value),
            };
            (found.trajectory, decided)
        })
    }
}
