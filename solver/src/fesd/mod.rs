//! Simulation by finite elements with switch detection (FESD)
//!
//! x' = f(t, x, z),   0 = g(t, x, z),   0 ≤ a ⟂ b ≥ 0
//!
//! Every step of the grid is cut into finite elements with a Runge-Kutta method each, whose lengths are unknowns: a
//! switch is the end of an element (Nurkanović et al. 2024). The complementarity problem that this is needs no
//! mathematical program. In each element one member of every pair is zero throughout, so the active set of the element
//! before predicts the next one: Newton's method solves what is left, the signs of the other members say whether the
//! set was right, and where one of them vanishes the element ends. There the derivatives of the members say which set
//! is next.

mod adaptive;
mod branch;
mod element;
mod emit;
mod fold;
pub mod jumps;
mod march;
pub(crate) mod selection;
mod slip;
mod stepping;
mod system;
mod uniform;
mod watch;

use rustc_hash::FxHashMap;

use crate::events::roots::RootFinder;
use crate::events::zeno::Events;
use crate::expansion::dense::ElementSeries;
use crate::fesd::element::nodes::Nodes;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::selection::directional::Directional;
pub use crate::fesd::system::full::Kinds;
use crate::fesd::system::hidden::Hidden;
pub use crate::fesd::system::library::Library;
pub use crate::fesd::system::pointwise::{Leading, Rule, Rules, Surfaces, alpha_of, alphas_of};
use crate::hybrid::{Note, Outcome, Side, Stats, Status};
use crate::integrate::tableau::{Family, Tableau, TableauError};
use crate::runtime::limit::Limit;
use crate::selector::{Decision, ModeSelector};
use element::Element;
pub use emit::{Multipliers, Observer};
pub use stepping::{Stepper, SteppingSettings};
pub use system::{
    ComplementaritySystem, Disc, Full, Kept, Member, NEGLIGIBLE, Pair, Reduced, Switch, Watched,
    Zero,
};
use watch::{Start, Values};

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The family of Runge-Kutta methods.
    pub family: Family,
    /// Its number of nodes.
    pub nodes: usize,
    /// How time is divided.
    pub grid: Grid,
    /// Largest number of elements.
    pub max_elements: usize,
    /// Largest number of events.
    pub max_events: usize,
    /// When the run stops.
    pub limit: Limit,
    /// Switches that are below their surface where several sets go on that differ in them.
    pub below: Vec<usize>,
}

impl Settings {
    /// A family with a number of nodes, and defaults.
    pub fn new(family: Family, nodes: usize) -> Self {
        Settings {
            family,
            nodes,
            grid: Grid::Adaptive { tolerance: 1e-8 },
            max_elements: 10_000_000,
            max_events: 1_000_000,
            limit: Limit::default(),
            below: Vec::new(),
        }
    }
}

/// How time is divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Grid {
    /// Steps of one length, with as many elements each; at most that many switches less one fit in
    /// a step before elements are added.
    Steps {
        /// Number of steps, at least 1.
        steps: usize,
        /// Elements per step, at least 1.
        elements: usize,
    },
    /// One element after the other, as long as the aim for the global error allows.
    Adaptive {
        /// Relative to the largest magnitude of each state; in (0, 1).
        tolerance: f64,
    },
}

/// How the active set after a switch was found; each is tried where those before it fail.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
pub struct Rungs {
    /// By the first derivatives of the members.
    pub predicted: usize,
    /// By trial elements, where a rate vanishes.
    pub tried: usize,
    /// By a smoothed complementarity problem, where too many pairs meet to try all sets.
    pub smoothed: usize,
    /// By the complementarity problem of a whole element, where all of these find none.
    pub whole: usize,
}

/// The end of a run, with what concerns elements only.
#[derive(Clone, Debug)]
pub struct Solution {
    /// As of every simulation.
    pub outcome: Outcome,
    /// Elements added to steps with more switches than elements.
    pub added_elements: usize,
    /// How active sets were found.
    pub rungs: Rungs,
    /// Least member at a node, relative to the size of its pair: zero or rounding.
    pub least_member: f64,
}

/// Breakpoints and ends of steps this close, relative to time, are one instant.
const NEAR: f64 = 16.0 * f64::EPSILON;

/// What has been compiled and factored for an active set.
struct Mode {
    element: Element,
    hidden: Hidden,
}

/// Runs a system, keeping the functions it has met from one run to the next.
pub struct Simulator<'s> {
    system: &'s ComplementaritySystem,
    settings: Settings,
    scheme: Scheme,
    library: Library,
    /// Places in `modes`; none for sets without functions.
    known: FxHashMap<Vec<Zero>, Option<usize>>,
    modes: Vec<Mode>,
    /// Branches of sliding modes, by the mode, the unknown that takes the place of time, and whether it rises.
    branches: FxHashMap<(usize, usize, bool), Mode>,
    directional: Directional,
    /// Chooses among sliding modes, where switches are nonlinear.
    mode_selector: Option<Box<dyn ModeSelector + 's>>,
    /// Memory for whole elements, once one is needed.
    nodes: Option<Nodes>,
    /// What changes at breakpoints, as it is now.
    numbers: Vec<f64>,
    values: Values,
    roots: RootFinder,
    /// The elements solved since the last one that was reported.
    solved: Vec<march::Solved>,
    series: ElementSeries,
    near: fold::Near,
}

/// A run on its way.
pub(crate) struct Run {
    t: f64,
    /// What rounding took from t: lost, it would be the same after every switch of a long run, a drift of phase.
    t_low: f64,
    /// When it ends.
    t1: f64,
    x: Vec<f64>,
    /// What rounding took from x, so that sums over many elements stay exact.
    low: Vec<f64>,
    z: Vec<f64>,
    zeros: Vec<Zero>,
    mode: usize,
    /// How the watched members of the mode start in the next element.
    starts: Vec<Start>,
    /// The next breakpoint; infinity where there is none.
    until: f64,
    /// Values of the watched members that count as zero, over [`watch::BAND`].
    sizes: Vec<f64>,
    /// What rates of members are zero next to.
    rate_scale: f64,
    /// Largest magnitude of each state so far, see [`system::measure`].
    scale: Vec<f64>,
    /// ∫ of the sizes of the terms of each rate.
    work: Vec<f64>,
    /// Length of the last element in this mode, zero before the first.
    last: f64,
    /// Length of the next element by the tolerance, zero before the first.
    next: f64,
    /// The same where α is the independent variable.
    next_branch: f64,
    rates: Vec<f64>,
    stats: Stats,
    added: usize,
    rungs: Rungs,
    least_member: f64,
    defect: f64,
    /// Events in a row that took no time.
    stalled: usize,
    events: Events,
    slips: slip::Slips,
    /// What has decided about nonlinear switches where the run is.
    decisions: Vec<Decision>,
    /// The switch whose sliding mode has ended in a fold where the run is.
    fold: Option<usize>,
    notes: Vec<Note>,
}

impl Run {
    /// Whether data goes on with other pieces at the present time.
    fn is_at_breakpoint(&self) -> bool {
        self.until <= self.t + NEAR * self.t.abs()
    }

    /// Moves to an instant that is known.
    fn go_to(&mut self, t: f64) {
        (self.t, self.t_low) = (t, 0.0);
    }

    /// The time to an instant.
    fn left(&self, end: f64) -> f64 {
        (end - self.t) - self.t_low
    }

    /// The values of some algebraic variables.
    fn z_of(&self, variables: &[usize]) -> Vec<f64> {
        variables.iter().map(|&i| self.z[i]).collect()
    }
}

impl<'s> Simulator<'s> {
    /// A simulator that has met no active set yet.
    pub fn new(
        system: &'s ComplementaritySystem,
        settings: Settings,
    ) -> Result<Self, TableauError> {
        let scheme = Scheme::new(Tableau::new(settings.family, settings.nodes)?);
        Ok(Simulator {
            system,
            settings,
            library: Library::default(),
            known: FxHashMap::default(),
            modes: Vec::new(),
            branches: FxHashMap::default(),
            directional: Directional::new(system),
            mode_selector: None,
            nodes: None,
            numbers: vec![0.0; system.n_numbers()],
            values: Values::default(),
            roots: RootFinder::new(scheme.points.len()),
            scheme,
            solved: Vec::new(),
            series: ElementSeries::default(),
            near: fold::Near::default(),
        })
    }

    /// Lets a selector choose the modes of a system with nonlinear switches.
    pub fn with_mode_selector(mut self, mode_selector: impl ModeSelector + 's) -> Self {
        self.mode_selector = Some(Box::new(mode_selector));
        self
    }

    /// Takes what other runs of the system have made of its functions.
    pub fn knowing(mut self, library: Library) -> Self {
        self.library = library;
        self
    }

    /// What runs have made of its functions.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Order of the method where nothing switches.
    pub fn order(&self) -> usize {
        self.scheme.tableau.order
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut impl Observer) -> Solution {
        let (before, known) = (self.work(), self.n_functions());
        let mut run = Run {
            t: t0,
            t_low: 0.0,
            t1,
            x: x0.to_vec(),
            low: vec![0.0; x0.len()],
            z: self.system.start.to_vec(),
            zeros: Vec::new(),
            mode: 0,
            starts: Vec::new(),
            until: f64::INFINITY,
            sizes: Vec::new(),
            rate_scale: 0.0,
            scale: vec![0.0; x0.len()],
            work: vec![0.0; x0.len()],
            last: 0.0,
            next: 0.0,
            next_branch: 0.0,
            rates: vec![0.0; x0.len()],
            stats: Stats::default(),
            added: 0,
            rungs: Rungs::default(),
            least_member: 0.0,
            defect: 0.0,
            stalled: 0,
            events: Events::default(),
            slips: slip::Slips::default(),
            decisions: Vec::new(),
            fold: None,
            notes: Vec::new(),
        };
        system::measure(&mut run.scale, x0, &self.system.algebraic_states);
        let status = match self.integrate(&mut run, t0, t1, observer) {
            Ok(()) => Status::Solved,
            Err(status) => status,
        };
        let after = self.work();
        run.stats.newton_iterations += after[0] - before[0];
        run.stats.factorizations += after[1] - before[1];
        run.stats.rhs_evaluations = after[2] - before[2];
        run.stats.functions = self.n_functions() - known;
        let elapsed = if run.t > t0 { run.t - t0 } else { 1.0 };
        let n = x0.len();
        let alive = !run.zeros.is_empty() || self.system.pairs.is_empty();
        let sides = match self.modes.get(run.mode).filter(|_| alive) {
            Some(mode) => mode.element.reduced.sides.to_vec(),
            None => vec![Side::Plus; self.system.n_switches()],
        };
        let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
        if alive && !self.modes.is_empty() {
            self.alphas(&run, &mut alpha);
        }
        Solution {
            outcome: Outcome {
                status,
                time: run.t,
                x: run.x,
                sides,
                alpha,
                activity: run.work.iter().map(|work| work / elapsed).collect(),
                moved: vec![0.0; n],
                drift: 0.0,
                defect: run.defect,
                complementarity: 0.0,
                notes: run.notes,
                approaches: Vec::new(),
                stats: run.stats,
            },
            added_elements: run.added,
            rungs: run.rungs,
            least_member: run.least_member,
        }
    }

    /// Iterations, factorizations and evaluations so far.
    fn work(&self) -> [usize; 3] {
        let all = self.modes.iter().chain(self.branches.values());
        all.fold([0; 3], |sum, Mode { element, .. }| {
            let own = [
                element.iterations,
                element.factorizations,
                element.evaluations,
            ];
            std::array::from_fn(|i| sum[i] + own[i])
        })
    }

    /// Active sets and branches that have functions.
    fn n_functions(&self) -> usize {
        self.modes.len() + self.branches.len()
    }

    fn integrate(
        &mut self,
        run: &mut Run,
        t0: f64,
        t1: f64,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        self.load(run, t0);
        if let Some(switch) = self.system.below(self.point(run)) {
            return Err(Status::Penetrates { switch });
        }
        self.begin(run, t1 - t0)?;
        match self.settings.grid {
            Grid::Steps { steps, elements } => {
                for k in 1..=steps {
                    let end = if k == steps {
                        t1
                    } else {
                        t0 + (t1 - t0) * (k as f64 / steps as f64)
                    };
                    self.pieces(run, end, observer, |simulator, run, end, observer| {
                        simulator.interval(run, end, elements, observer)
                    })?;
                }
                Ok(())
            }
            Grid::Adaptive { tolerance } => {
                let mut end = t0;
                while end < t1 {
                    end = self.system.stop(end).min(t1);
                    self.pieces(run, end, observer, |simulator, run, end, observer| {
                        simulator.adapt(run, end, tolerance, observer)
                    })?;
                }
                Ok(())
            }
        }
    }

    /// Integrates to `end` from breakpoint to breakpoint.
    fn pieces<O: Observer>(
        &mut self,
        run: &mut Run,
        end: f64,
        observer: &mut O,
        integrate: impl Fn(&mut Self, &mut Run, f64, &mut O) -> Result<(), Status>,
    ) -> Result<(), Status> {
        let (length, near) = (end - run.t, NEAR * end.abs());
        while run.until < end - near {
            if !run.is_at_breakpoint() {
                let until = run.until;
                integrate(self, run, until, observer)?;
            }
            self.pass_breakpoint(run, length, observer)?;
        }
        if run.t < end {
            integrate(self, run, end, observer)?;
        }
        Ok(())
    }

    /// Whether a run has to stop.
    fn limit(&self, run: &Run) -> Result<(), Status> {
        if run.stats.steps >= self.settings.max_elements {
            return Err(Status::StepLimit);
        }
        if run.stats.events >= self.settings.max_events {
            return Err(Status::EventLimit);
        }
        Ok(self.settings.limit.check()?)
    }

    /// The place of the functions of an active set.
    fn mode(&mut self, zeros: &[Zero]) -> Option<usize> {
        if let Some(&known) = self.known.get(zeros) {
            return known;
        }
        let n = self.system.n_states();
        let reduced = self.library.reduced(self.system, zeros);
        let place = reduced.map(|reduced| {
            let n_numbers = self.numbers.len();
            let mut mode = Mode {
                hidden: Hidden::new(n, n_numbers, &reduced),
                element: Element::new(&self.scheme, n, n_numbers, reduced),
            };
            mode.element.follow(&self.system.algebraic_states);
            mode.element.set_numbers(&self.numbers);
            mode.hidden.set_numbers(&self.numbers);
            self.modes.push(mode);
            self.modes.len() - 1
        });
        self.known.insert(zeros.to_vec(), place);
        place
    }
}
