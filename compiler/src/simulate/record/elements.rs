//! Elements as a trajectory, whatever has solved for their values.
//!
//! Where states have jumped there are two values at one time.

use std::sync::Arc;

use nsd_solver::fesd::jumps::{Kind, Shape};
use nsd_solver::hybrid::Side;

use crate::report::{Dense, Piece, Trajectory};
use crate::simulate::record::points::{Behind, Points, is_one_instant, multiple};
use crate::simulate::record::{pieces, recorded};
use crate::system::experiment::{Sampling, Settings};
use crate::system::{Role, Switch, System};

/// What the solver knows of elements of a system: where the nodes of one of length 1 are, and what α mean.
pub(crate) fn shape(system: &System, nodes: &[f64], n_nodes: usize) -> Shape {
    let contacts = &system.jumps.contacts;
    let is_contact = |k: usize| contacts.iter().any(|contact| contact.switch == k);
    let kind = |(k, switch): (usize, &Switch)| match (switch.role, switch.across) {
        (Role::Equation, _) => Kind::Equation,
        (Role::Member(other), _) => Kind::Member(other),
        (Role::Step, Some(other)) => Kind::Disc(other),
        (Role::Step, None) if is_contact(k) => Kind::Contact,
        (Role::Step, None) if switch.unilateral => Kind::Force,
        (Role::Step, None) => Kind::Step,
    };
    let switches = system.switches.iter().enumerate();
    Shape::new(nodes, n_nodes, switches.map(kind).collect())
}

/// Points, polynomials and sides, element by element.
pub(crate) struct Elements<'s, 'e> {
    system: &'s System<'e>,
    shape: Shape,
    points: Points,
    pieces: Vec<Piece>,
    sides: Vec<(f64, Box<[Side]>)>,
    /// Whether controls have other values from here on, be they the same.
    controls_step: bool,
}

impl<'s, 'e> Elements<'s, 'e> {
    pub fn new(system: &'s System<'e>, nodes: &[f64], n_nodes: usize) -> Self {
        Elements {
            system,
            shape: shape(system, nodes, n_nodes),
            points: Points::default(),
            pieces: Vec::new(),
            sides: Vec::new(),
            controls_step: false,
        }
    }

    /// An interval of controls begins.
    pub fn step_controls(&mut self) {
        self.controls_step = true;
    }

    /// The state at an instant.
    pub fn point(&mut self, t: f64, x: &[f64], alphas: &[f64]) {
        let n = self.system.states.len();
        self.points.push(t, &x[..n], alphas);
    }

    /// States jump by laws.
    pub fn jump(
        &mut self,
        t: f64,
        mut laws: Vec<usize>,
        [before, after]: [&[f64]; 2],
        alphas: &[f64],
    ) {
        let n = self.system.states.len();
        laws.sort_unstable();
        laws.dedup();
        self.points.jump(t, laws, &before[..n], &after[..n]);
        self.points.push(t, &after[..n], alphas);
    }

    /// An element with the instants and states of its nodes and ends, and α at its nodes.
    pub fn element(&mut self, instants: &[f64], x: &[&[f64]], alphas: &[Vec<f64>]) {
        let (system, n) = (self.system, self.system.states.len());
        let x: Vec<&[f64]> = x.iter().map(|x| &x[..n]).collect();
        let member = |switch, t, x: &[f64]| member(system, switch, t, x);
        let (found, sides) = self.shape.element(instants, &x, alphas, member);
        let found = Piece {
            from: found.from,
            to: found.to,
            n_coefficients: found.n_coefficients,
            coefficients: found.coefficients,
        };
        let piece = pieces::with_data(found, &system.exogenous.data);
        let from = piece.from;
        let has_turned = self.sides.last().is_some_and(|(_, last)| *last != sides);
        let is_certain = std::mem::take(&mut self.controls_step);
        let changes = has_turned || is_certain || system.steps_at(from);
        if self.points.last_instant() == Some(from) && changes {
            let m = system.switches.len();
            let alphas = piece.coefficients[n * piece.n_coefficients..].iter();
            self.points.go_on(Behind {
                x: x[0].to_vec(),
                alpha: alphas
                    .step_by(piece.n_coefficients)
                    .take(m)
                    .copied()
                    .collect(),
                is_certain,
            });
        }
        self.sides.push((from, sides));
        self.pieces.push(piece);
    }

    /// The trajectory to the horizon, with some parameters open, by their numbers.
    pub fn finish(mut self, settings: &Settings, horizon: f64, open: &[usize]) -> Trajectory {
        if let Some(piece) = self.pieces.last_mut() {
            piece.to = horizon;
        }
        let dense = Dense {
            pieces: self.pieces.into(),
        };
        let (n, m) = (self.system.states.len(), self.system.switches.len());
        let sampling = &settings.recording.sampling;
        let mut points = match sampling {
            Sampling::Method | Sampling::Curve => self.points,
            // A run without a first element has its start alone.
            _ if dense.pieces.is_empty() => self.points,
            _ => sampled(&dense, sampling, horizon, (n, m), self.points),
        };
        points.end(self.system);
        recorded(
            self.system,
            settings,
            points,
            Arc::unwrap_or_clone(dense.pieces),
            &self.sides,
            open,
        )
    }
}

/// The polynomials at the instants that the experiment asks for.
fn sampled(
    dense: &Dense,
    sampling: &Sampling,
    horizon: f64,
    (n, m): (usize, usize),
    known: Points,
) -> Points {
    let instants: Vec<f64> = match sampling {
        Sampling::Method | Sampling::Curve => Vec::new(),
        Sampling::Every(period) => {
            let instants = (0..).map(|k| multiple(*period, k, horizon));
            let inner = instants.take_while(|t| *t < horizon);
            inner.chain([horizon]).collect()
        }
        Sampling::At(instants) => instants.iter().copied().filter(|t| *t <= horizon).collect(),
    };
    let breaks = known.breaks();
    let mut points = Points::default();
    for t in instants {
        let is_here = |at: f64| is_one_instant(at, t);
        let first = (dense.pieces).partition_point(|piece| piece.from < t && !is_here(piece.from));
        let meeting = first
            .checked_sub(1)
            .and_then(|k| dense.pieces.get(k..k + 2));
        let meeting = meeting.filter(|pieces| is_here(pieces[1].from));
        let is_certain = meeting.and_then(|_| {
            let here = breaks.iter().filter(|(at, _)| is_here(*at));
            here.map(|(_, is_certain)| *is_certain)
                .reduce(|a, b| a || b)
        });
        let rows = match meeting.zip(is_certain) {
            Some((pieces, _)) => pieces.iter().map(|piece| piece.at(t)).collect(),
            None => Vec::from_iter(dense.at(t)),
        };
        let mut rows = rows.iter().map(|row| row[..n + m].split_at(n));
        if let Some((x, alpha)) = rows.next() {
            points.push(t, x, alpha);
        }
        if let Some((x, alpha)) = rows.next() {
            points.go_on(Behind {
                x: x.to_vec(),
                alpha: alpha.to_vec(),
                is_certain: is_certain == Some(true),
            });
        }
    }
    points.jumps = known.jumps;
    points
}

/// -ψ of a member of a pair, or of a contact, without kinks, at a time and a state.
fn member(system: &System, switch: usize, t: f64, x: &[f64]) -> f64 {
    let alphas = vec![0.5; system.switches.len()];
    -(system.valuation(t, x, &alphas)).value(system.switches[switch].psi)
}
