//! Systems built by hand, together with their nonsmooth originals.

use crate::expr::{Expr, Exprs, Substitution};
use crate::source::Span;
use crate::system::{
    Continuity, Coupling, Coverage, Partition, Region, State, Subsystem, Switch, System,
};

/// A system, and the rates as the user wrote them with `sign`, `max` and so on.
pub struct Fixture<'e> {
    pub system: System<'e>,
    pub original: Vec<Expr<'e>>,
}

/// A region by name and literals (switch, positive).
pub type RegionOf<'a> = (&'a str, &'a [(usize, bool)]);

/// Builds a system of states and switches `(name, ψ)`; the original has step(ψ) for α.
pub struct Builder<'e> {
    pub exprs: &'e Exprs,
    pub time: Expr<'e>,
    pub states: Vec<Expr<'e>>,
    switches: Vec<Switch<'e>>,
    partitions: Vec<Partition<'e>>,
}

impl<'e> Builder<'e> {
    pub fn new(exprs: &'e Exprs, states: &[&str]) -> Self {
        Builder {
            exprs,
            time: exprs.variable("time"),
            states: states.iter().map(|name| exprs.variable(name)).collect(),
            switches: Vec::new(),
            partitions: Vec::new(),
        }
    }

    /// α of a new switch.
    pub fn switch(&mut self, name: &str, psi: Expr<'e>) -> Expr<'e> {
        self.add(name, psi, Continuity::Discontinuous)
    }

    /// α of a new switch across which the dynamics are continuous.
    pub fn kink(&mut self, name: &str, psi: Expr<'e>) -> Expr<'e> {
        self.add(name, psi, Continuity::Certain)
    }

    fn add(&mut self, name: &str, psi: Expr<'e>, continuity: Continuity) -> Expr<'e> {
        let alpha = self.exprs.variable("alpha");
        self.switches.push(Switch {
            relay: None,
            is_nonlinear: false,
            unilateral: false,
            slip_of: None,
            across: None,
            role: crate::system::Role::Step,
            name: name.to_owned(),
            alpha,
            psi,
            continuity,
            named: Vec::new(),
            spans: vec![Span::default()],
        });
        alpha
    }

    /// Weights of the regions of a new partition.
    pub fn partition(&mut self, regions: &[RegionOf]) -> Vec<Expr<'e>> {
        let weight = |literals: &[(usize, bool)]| {
            let factor = |&(k, plus): &(usize, bool)| {
                let alpha = self.switches[k].alpha;
                if plus { alpha } else { 1.0 - alpha }
            };
            self.exprs.product(literals.iter().map(factor))
        };
        let built = regions.iter().map(|(name, literals)| Region {
            name: (*name).to_owned(),
            weight: weight(literals),
            literals: Some(literals.to_vec()),
            span: Span::default(),
        });
        let regions: Vec<Region> = built.collect();
        let weights = regions.iter().map(|region| region.weight).collect();
        self.partitions.push(Partition {
            switches: (0..self.switches.len()).collect(),
            states: Vec::new(),
            coverage: Coverage::Proven,
            indicators: Vec::new(),
            regions,
        });
        weights
    }

    pub fn finish(
        self,
        rates: &[Expr<'e>],
        subsystems: &[(&[usize], Option<usize>)],
    ) -> Fixture<'e> {
        let mut steps = Substitution::new();
        for switch in &self.switches {
            let var = switch.alpha.as_variable().expect("α is a variable");
            let step = switch.psi.substitute(&steps).step();
            steps.insert(var, step);
        }
        let states = self.states.iter().zip(rates).map(|(&var, &rate)| State {
            name: var.to_string(),
            var,
            initial: 1.0,
            rate,
            span: Span::default(),
        });
        let subsystems = subsystems.iter().map(|&(switches, regions)| Subsystem {
            switches: switches.to_vec(),
            regions,
        });
        Fixture {
            original: rates.iter().map(|rate| rate.substitute(&steps)).collect(),
            system: System {
                exprs: self.exprs,
                name: "fixture".to_owned(),
                time: self.time,
                clock: None,
                exogenous: Default::default(),
                states: states.collect(),
                switches: self.switches,
                coupling: Coupling {
                    partitions: self.partitions,
                    subsystems: subsystems.collect(),
                },
                jumps: Default::default(),
                recorded: Default::default(),
                task: None,
                provenance: Default::default(),
            },
        }
    }
}

/// x' = 2 - sign(x).
pub fn relay(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x"]);
    let alpha = b.switch("x", b.states[0]);
    b.finish(&[2.0 - (2.0 * alpha - 1.0)], &[(&[0], None)])
}

/// The Filippov spiral: two switches that only add up.
pub fn two_relays(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x[1]", "x[2]"]);
    let s = [0, 1].map(|i| 2.0 * b.switch(&format!("x[{}]", i + 1), b.states[i]) - 1.0);
    b.finish(
        &[2.0 * s[1] - s[0], -2.0 * s[0] - s[1]],
        &[(&[0], None), (&[1], None)],
    )
}

/// x[3]' = sign(x[1])*sign(x[2]): switches that multiply each other.
pub fn product_of_signs(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x[1]", "x[2]", "x[3]"]);
    let s = [0, 1].map(|i| 2.0 * b.switch(&format!("x[{}]", i + 1), b.states[i]) - 1.0);
    b.finish(&[0.5 - s[0], -s[1], s[0] * s[1]], &[(&[0, 1], None)])
}

/// Regions where the first leaves a sign open.
pub fn open_sign(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x", "y"]);
    let (x, y) = (b.states[0], b.states[1]);
    b.switch("x", x);
    b.switch("y - x^2", y - x * x);
    let w = b.partition(&[
        ("right", &[(0, true)]),
        ("above", &[(0, false), (1, true)]),
        ("below", &[(0, false), (1, false)]),
    ]);
    let x_rate = w[0] * y + w[1] * 2.0 - w[2] * x;
    b.finish(&[x_rate, exprs.constant(1.0)], &[(&[0, 1], Some(0))])
}

/// Intervals of one state: x > 2 and x < 1 exclude each other, but share no switch.
pub fn intervals(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x"]);
    let x = b.states[0];
    b.switch("1 - x", 1.0 - x);
    b.switch("2*x - 4", 2.0 * x - 4.0);
    let w = b.partition(&[
        ("high", &[(1, true)]),
        ("low", &[(0, true)]),
        ("middle", &[(0, false), (1, false)]),
    ]);
    b.finish(&[w[1] - w[0] * x + 3.0 * w[2]], &[(&[0, 1], None)])
}

/// x' = 1 + max(0, x), y' = |y| - min(x, y).
pub fn kinks(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x", "y"]);
    let (x, y) = (b.states[0], b.states[1]);
    let a = b.kink("x", x);
    let c = b.kink("y", y);
    let d = b.kink("x - y", x - y);
    let minimum = x + d * (y - x);
    let mut fixture = b.finish(
        &[1.0 + a * x, (2.0 * c - 1.0) * y - minimum],
        &[(&[0], None), (&[1], None), (&[2], None)],
    );
    fixture.original = vec![1.0 + exprs.constant(0.0).max(x), y.abs() - x.min(y)];
    fixture
}

/// x' = sign(|x| - y) times six more signs: a product of many, under a nested switch.
pub fn many(exprs: &Exprs) -> Fixture<'_> {
    let mut b = Builder::new(exprs, &["x", "y"]);
    let (x, y) = (b.states[0], b.states[1]);
    let a = b.kink("x", x);
    let nested = b.switch("abs(x) - y", (2.0 * a - 1.0) * x - y);
    let more: Vec<Expr> = (1..=5)
        .map(|i| b.switch(&format!("s[{i}]"), (f64::from(i) * x).sin() - y))
        .collect();
    let product = exprs.product(more.iter().map(|&alpha| 2.0 * alpha - 1.0));
    b.finish(
        &[
            (2.0 * nested - 1.0) * product,
            nested - more[0] * (1.0 - more[1]) * x,
        ],
        &[(&[0], None), (&[1, 2, 3, 4, 5, 6], None)],
    )
}
