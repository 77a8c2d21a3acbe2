//! Finite elements on the oscillator: the cheapest grid for an error, what it costs, and beside it
//! the event road with that tolerance, and the peer with hand-written modes.

#[path = "support/peers.rs"]
mod peers;
mod support;

use criterion::Criterion;
use nsd_solver::fesd::{Grid, Observer, Settings, Simulator};
use nsd_solver::integrate::tableau::Family;
use nsd_tests::with_experiment;
use nsdc::lowering::dcs;
use nsdc::lowering::hybrid;
use nsdc::simulate::fesd::complementarity;
use serde_json::json;
use support::{Silent, median, print, start};

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");

/// Errors in the end state, and the microseconds that a run may take for them on a machine on which
/// diffsol takes the second number.
const BARS: [(f64, f64, f64); 3] = [(1e-6, 12.0, 35.0), (1e-9, 27.0, 76.0), (1e-12, 63.0, 432.0)];

/// More steps than any of the errors needs.
const MOST_STEPS: usize = 400;

impl Observer for Silent {}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let text = format!("{OSCILLATOR}\nsimulate bench of oscillator {{ horizon pi/2; }}");
    with_experiment(&text, "bench", |compiled| {
        let dcs = dcs::lower(&compiled.system, &[]).expect("one switch has Stewart's form");
        let system = complementarity(&compiled.system, &dcs);
        let (x0, horizon) = (start(compiled), compiled.settings.horizon);
        // x(T) = e^(T-1) (cos 2π(T-1), sin 2π(T-1))
        let (radius, angle) = (
            (horizon - 1.0).exp(),
            std::f64::consts::TAU * (horizon - 1.0),
        );
        let exact = [radius * angle.cos(), radius * angle.sin()];
        let simulator = |steps: usize| {
            let grid = Grid::Steps { steps, elements: 1 };
            let settings = Settings {
                grid,
                ..Settings::new(Family::RadauIia, 4)
            };
            Simulator::new(&system, settings).expect("four nodes are allowed")
        };
        let error = |steps: usize| {
            let x = simulator(steps)
                .run(0.0, horizon, &x0, &mut Silent)
                .outcome
                .x;
            (x[0] - exact[0]).hypot(x[1] - exact[1])
        };
        let peers = peers::run(
            &peers::Script::new("oscillator.py"),
            compiled,
            &exact,
            json!({}),
        );
        let peer = |wanted: f64| {
            let diffsol = peers
                .iter()
                .filter(|row| row.solver.starts_with("diffsol") && row.error <= wanted);
            diffsol.map(|row| 1e6 * row.seconds).reduce(f64::min)
        };
        print(&format!(
            "{:>7} {:>6} {:>9} {:>9} {:>5} {:>9} {:>9} {:>6} {:>5}",
            "error", "steps", "reached", "us", "bar", "events", "diffsol", "ratio", "bar"
        ));
        for (wanted, bar, bar_of_peer) in BARS {
            let Some(steps) = (5..=MOST_STEPS).find(|&steps| error(steps) <= wanted) else {
                print(&format!("{wanted:>7.0e}  never"));
                continue;
            };
            let mut simulator = simulator(steps);
            let mut call = || {
                simulator.run(0.0, horizon, &x0, &mut Silent);
            };
            criterion.bench_function(&format!("oscillator, {wanted:e}"), |bencher| {
                bencher.iter(&mut call)
            });
            let time = 1e6 * median(call);
            let hybrid = hybrid::lower(&compiled.system);
            let mut events = support::simulator(&hybrid, wanted);
            let beside = 1e6
                * median(|| {
                    events.run(0.0, horizon, &x0, &mut Silent);
                });
            let (peer_time, ratio) = match peer(wanted) {
                Some(peer) => (format!("{peer:.1}"), format!("{:.3}", time / peer)),
                None => ("-".into(), "-".into()),
            };
            print(&format!(
                "{wanted:>7.0e} {steps:>6} {:>9.1e} {time:>9.1} {bar:>5} {beside:>9.1} \
                 {peer_time:>9} {ratio:>6} {:>5.3}",
                error(steps),
                bar / bar_of_peer
            ));
        }
    });
    criterion.final_summary();
}
