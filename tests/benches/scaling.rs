//! What size costs that should not cost anything: switches that are not needed, switches that do
//! not switch, parts that are all alike.

mod support;

use criterion::Criterion;
use nsd_tests::with_experiment;
use nsdc::lowering::hybrid;
use support::{Silent, median, print, simulator, start};

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let many = run(&mut criterion, "200 relays, one wanted", &relays(200));
    let one = run(&mut criterion, "one relay", &relays(1));
    let all = run(
        &mut criterion,
        "200 relays, one switches",
        &idle("sign(x[i])"),
    );
    let without = run(&mut criterion, "200 states, one relay", &idle("1"));
    let signs = compile(&mut criterion, "20 sign terms", &signs(20));
    let parts = compile(&mut criterion, "2000 parts", &parts(2000));

    print(&format!("\n{:>9} {:>7}", "measured", "bar"));
    print(&format!(
        "{:>9.2} {:>7}  200 relays, one wanted, to one alone",
        many / one,
        1.2
    ));
    print(&format!(
        "{:>9.2} {:>7}  200 relays, one switches, to 200 states with one relay",
        all / without,
        1.3
    ));
    print(&format!(
        "{:>6.1} ms {:>4} ms  20 sign terms, from text to tapes",
        signs * 1e3,
        50
    ));
    print(&format!(
        "{:>6.1} ms {:>4} ms  2000 parts, from text to tapes",
        parts * 1e3,
        1000
    ));
    criterion.final_summary();
}

/// Relays that switch often, of which the first is wanted.
fn relays(n: usize) -> String {
    format!(
        "model relays {{ \
           const n = {n}; state x[n] = [0.1*sin(i) for i in 1..n]; \
           for i in 1..n {{ x[i]' = cos((1 + (i - 1)/200)*time) - 0.5*sign(x[i]); }} \
         }}\n\
         simulate bench of relays {{ horizon 10; output x[1]; }}"
    )
}

/// A relay that switches 63 times, and 199 that stay above; `term` is what they take from their side.
fn idle(term: &str) -> String {
    format!(
        "model relays {{ \
           const n = 200; state x[n] = 3*ones(n); \
           x[1]' = sign(sin(20*time)); \
           for i in 2..n {{ x[i]' = cos(time) + 0.1*x[i - 1] - 0.1*x[i] - 0.1*{term}; }} \
         }}\n\
         simulate bench of relays {{ horizon 10; }}"
    )
}

/// Sign terms in one equation each, none of which sees another.
fn signs(n: usize) -> String {
    format!(
        "model signs {{ \
           const n = {n}; state x[n] = [sin(i) for i in 1..n]; \
           x' = cos(time)*ones(n) - sign(x); \
         }}\n\
         simulate bench of signs {{ horizon 1; }}"
    )
}

/// Instances of a part with a switch of its own.
fn parts(n: usize) -> String {
    format!(
        "model relay {{ param level = 1; input u; state x = 0.5; x' = u - level*sign(x); }}\n\
         model all {{ \
           state y = 1; y' = -y; \
           part r[i in 1..{n}] = relay {{ u = y; level = 1 + i/{n}; }} \
         }}\n\
         simulate bench of all {{ horizon 1; }}"
    )
}

/// Seconds of a run, after compilation.
fn run(criterion: &mut Criterion, name: &str, text: &str) -> f64 {
    with_experiment(text, "bench", |compiled| {
        let hybrid = hybrid::lower(&compiled.system);
        let (mut simulator, x0) = (simulator(&hybrid, 1e-8), start(compiled));
        let mut call = || {
            simulator.run(0.0, compiled.settings.horizon, &x0, &mut Silent);
        };
        criterion.bench_function(name, |bencher| bencher.iter(&mut call));
        median(call)
    })
}

/// Seconds from text to what the simulator takes.
fn compile(criterion: &mut Criterion, name: &str, text: &str) -> f64 {
    let mut call = || {
        with_experiment(text, "bench", |compiled| {
            let hybrid = hybrid::lower(&compiled.system);
            let mut simulator = simulator(&hybrid, 1e-8);
            simulator.run(0.0, 1e-9, &start(compiled), &mut Silent);
        });
    };
    criterion.bench_function(name, |bencher| bencher.iter(&mut call));
    median(call)
}
