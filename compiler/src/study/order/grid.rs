//! The methods of a study, and the grids and tolerances of each from coarse to fine.

use nsd_solver::integrate::tableau::Family;

use super::Knob;
use crate::simulate::{Bench, Variant};
use crate::system::experiment::{
    FesdOptions, Law, Lowering, Method, MethodKind, Settings, SmoothingOptions,
};

/// Runs of one method.
pub struct Sweep {
    pub name: String,
    pub knob: Knob,
    /// Family of methods in the figures, and place in it.
    pub place: (usize, usize),
    /// Step size, tolerance or width, and the run, from coarse to fine.
    pub runs: Vec<(f64, Variant)>,
}

/// Schemes that are compared.
const SCHEMES: [(Family, usize); 6] = [
    (Family::RadauIia, 2),
    (Family::RadauIia, 3),
    (Family::RadauIia, 4),
    (Family::GaussLegendre, 2),
    (Family::GaussLegendre, 3),
    (Family::GaussLegendre, 4),
];
/// Schemes that step in time without detection.
const STEPPED: [(Family, usize); 2] = [(Family::RadauIia, 1), (Family::RadauIia, 2)];
/// Tolerances are powers of ten with these exponents.
const EXPONENTS: std::ops::RangeInclusive<i32> = 2..=13;
/// Widths are powers of ten with these exponents, and between two of them.
const WIDTHS: std::ops::RangeInclusive<i32> = 2..=13;
/// Steps of the coarsest grid, at least.
const FEWEST_STEPS: usize = 4;
/// So many more where the order is one, whatever the scheme.
const LOW_ORDER: usize = 16;
/// Taylor steps of a very accurate run for one step of the coarsest grid.
const SHARE: usize = 8;
/// Doublings of the coarsest grid, in this many refinements each: where a switch is in its step changes
/// the error by a factor of its own, which many grids average out.
const DOUBLINGS: u32 = 12;
const REFINEMENTS: u32 = 4;

/// What is run, and what cannot be run, with the reason. `steps` of a very accurate run say how long
/// the steps of the coarsest grid may be.
pub fn sweeps(
    bench: &Bench<'_, '_>,
    settings: &Settings,
    steps: usize,
) -> (Vec<Sweep>, Vec<(String, String)>) {
    let event = |tolerance| Variant::Event {
        tolerance,
        more_orders: 0,
    };
    let mut sweeps = vec![by_tolerance(MethodKind::Event.word(), (0, 0), event)];
    let mut left_out: Vec<(String, String)> = Vec::new();
    let branches = bench.with_branches();
    match bench.without_elements() {
        Some(reason) => {
            let both = [MethodKind::Fesd, MethodKind::Timestepping];
            left_out.extend(both.map(|method| (method.word().to_owned(), reason.to_owned())));
        }
        None => {
            let coarsest = coarsest(steps);
            sweeps.extend(fesd(settings, coarsest));
            if branches.is_none() {
                let stepped = STEPPED.into_iter().enumerate();
                sweeps.extend(
                    stepped.map(|(k, scheme)| timestepping(settings, coarsest, scheme, (3, k))),
                );
            }
        }
    }
    match bench.with_more_than_rates() {
        Some(reason) => {
            let both = [MethodKind::Smoothing, MethodKind::Adaptive];
            left_out.extend(both.map(|method| (method.word().to_owned(), reason.clone())));
        }
        None => {
            if bench.has_jumps() {
                sweeps.extend(Law::BUILT_IN.iter().enumerate().map(smoothing));
            }
            if branches.is_none() {
                let adaptive = |tolerance| Variant::Adaptive { tolerance };
                sweeps.push(by_tolerance(MethodKind::Adaptive.word(), (5, 3), adaptive));
            }
        }
    }
    if let Some(reason) = branches {
        let is_open = |name: &&str| left_out.iter().all(|(known, _)| known != name);
        let blind = MethodKind::ALL
            .into_iter()
            .filter(|method| !method.locates());
        let both = blind.map(MethodKind::word).filter(is_open);
        let both: Vec<_> = both.map(|name| (name.to_owned(), reason.clone())).collect();
        left_out.extend(both);
    }
    (sweeps, left_out)
}

/// A lowering, or a method, that takes jumps of states by a system of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Road {
    /// A clock stands still while states jump.
    Frozen,
    /// Contacts give impulses where finite elements meet.
    Impulses,
    /// Contacts give impulses in steps of time.
    Steps,
}

impl Road {
    /// All of them.
    pub const ALL: [Road; 3] = [Road::Frozen, Road::Impulses, Road::Steps];

    /// The settings of an experiment that goes it, besides which it asks for no lowering.
    pub fn settings(self) -> &'static [&'static str] {
        match self {
            Road::Frozen => &["method fesd", "lower timefreezing"],
            Road::Impulses => &["method fesd", "lower impact"],
            Road::Steps => &["method timestepping"],
        }
    }

    /// What it is called where it is left out.
    pub fn name(self) -> &'static str {
        match self {
            Road::Frozen => Lowering::TimeFreezing.word(),
            Road::Impulses => Lowering::Impact.word(),
            Road::Steps => MethodKind::Timestepping.word(),
        }
    }

    /// What is run of it; `steps` are as for `sweeps`.
    pub fn sweeps(self, settings: &Settings, steps: usize) -> Vec<Sweep> {
        let coarsest = coarsest(steps);
        let elements = match settings.numerics.method {
            Method::Fesd(options) => options.elements,
            _ => FesdOptions::default().elements,
        };
        let fesd = |family: usize| {
            let schemes = SCHEMES[..3].iter().enumerate();
            schemes.map(move |(k, &scheme)| {
                let sweep = self::elements(settings, coarsest, scheme, elements, (family, k));
                Sweep {
                    name: format!("{} {}", self.name(), sweep.name),
                    ..sweep
                }
            })
        };
        let event = |tolerance| Variant::Event {
            tolerance,
            more_orders: 0,
        };
        match self {
            Road::Frozen => {
                let event = by_tolerance("timefreezing event", (0, 1), event);
                [event].into_iter().chain(fesd(2)).collect()
            }
            Road::Impulses => fesd(1).collect(),
            Road::Steps => {
                let stepped = timestepping(settings, coarsest, STEPPED[0], (3, 0));
                vec![Sweep {
                    name: "timestepping, contacts".to_owned(),
                    ..stepped
                }]
            }
        }
    }
}

fn by_tolerance(name: &str, place: (usize, usize), variant: impl Fn(f64) -> Variant) -> Sweep {
    let run = |exponent: i32| {
        let tolerance = 10f64.powi(-exponent);
        (tolerance, variant(tolerance))
    };
    Sweep {
        name: name.into(),
        knob: Knob::Tolerance,
        place,
        runs: EXPONENTS.map(run).collect(),
    }
}

fn smoothing((member, &law): (usize, &Law<'static>)) -> Sweep {
    let run = |half: i32| {
        let epsilon = 10f64.powf(-0.5 * f64::from(half));
        (
            epsilon,
            Variant::Smoothing(SmoothingOptions { epsilon, law }),
        )
    };
    Sweep {
        name: format!("smoothing {}", law.word()),
        knob: Knob::Epsilon,
        place: (4, member),
        runs: WIDTHS.map(run).collect(),
    }
}

/// The method of the experiment on grids, where it takes a number of steps. `steps` are as for
/// [`sweeps`].
pub fn own(settings: &Settings, steps: usize) -> Option<Sweep> {
    let coarsest = coarsest(steps);
    match settings.numerics.method {
        Method::Fesd(options) => {
            let sweep = || elements(settings, coarsest, options.scheme, options.elements, (1, 0));
            options.steps.map(|_| sweep())
        }
        Method::Timestepping(options) => {
            Some(timestepping(settings, coarsest, options.scheme(), (3, 0)))
        }
        _ => None,
    }
}

fn coarsest(steps: usize) -> usize {
    FEWEST_STEPS.max(steps.div_ceil(SHARE))
}

/// All schemes, and the one that the experiment asks for.
fn fesd(settings: &Settings, coarsest: usize) -> Vec<Sweep> {
    let own = match settings.numerics.method {
        Method::Fesd(options) => Some(options),
        _ => None,
    };
    let count = own.unwrap_or_default().elements;
    let asked = own.map(|FesdOptions { scheme, .. }| scheme);
    let asked = asked.filter(|scheme| !SCHEMES.contains(scheme));
    let places = (0..SCHEMES.len()).map(|k| (1 + k / 3, k % 3));
    let all = SCHEMES.into_iter().zip(places);
    all.chain(asked.map(|scheme| (scheme, (1, 3))))
        .map(|(scheme, place)| elements(settings, coarsest, scheme, count, place))
        .collect()
}

/// Finite elements of one scheme, so many in each step.
fn elements(
    settings: &Settings,
    coarsest: usize,
    scheme: (Family, usize),
    elements: usize,
    place: (usize, usize),
) -> Sweep {
    let (family, nodes) = scheme;
    let run = |steps: usize| {
        let variant = Variant::Fesd {
            scheme,
            steps,
            elements,
        };
        (settings.horizon / (steps * elements) as f64, variant)
    };
    Sweep {
        name: format!("fesd {}({nodes})", family.word()),
        knob: Knob::Step,
        place,
        runs: grids(coarsest).into_iter().map(run).collect(),
    }
}

/// Steps in time with a scheme.
fn timestepping(
    settings: &Settings,
    coarsest: usize,
    scheme: (Family, usize),
    place: (usize, usize),
) -> Sweep {
    let (family, nodes) = scheme;
    let run = |steps: usize| {
        let variant = Variant::Timestepping { scheme, steps };
        (settings.horizon / steps as f64, variant)
    };
    Sweep {
        name: format!("timestepping {}({nodes})", family.word()),
        knob: Knob::Step,
        place,
        runs: grids(LOW_ORDER * coarsest).into_iter().map(run).collect(),
    }
}

/// Numbers of steps that grow evenly on a logarithmic scale, each once.
fn grids(coarsest: usize) -> Vec<usize> {
    let steps = |k: u32| {
        let doublings = f64::from(k) / f64::from(REFINEMENTS);
        (coarsest as f64 * doublings.exp2()).round() as usize
    };
    let mut grids: Vec<usize> = (0..=REFINEMENTS * DOUBLINGS).map(steps).collect();
    grids.dedup();
    grids
}
