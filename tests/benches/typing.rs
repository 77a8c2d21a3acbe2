//! How long the language server takes to answer while a text is typed, as a Markdown table.
//!
//! After each character of 200 truncations and of 200 edits of the examples, and of what is typed in a text of 500
//! declarations, an editor's questions are asked one by one, and each waits for its answer. The bench fails where one waits
//! longer than 100 ms.

#[path = "../tests/lsp/client.rs"]
#[allow(dead_code, reason = "tests use all of it")]
mod client;
#[allow(dead_code, reason = "other benchmarks use all of it")]
mod support;
#[path = "../tests/lsp/typist.rs"]
mod typist;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use serde_json::Value;

use client::{Client, memory};
use support::print;
use typist::{COUNT, Random, Typed, examples, large, questions};

/// Nobody waits longer.
const LIMIT: Duration = Duration::from_millis(100);
/// Characters of an example that are typed behind where it is cut.
const TYPED: usize = 20;

/// The times that answers took, by what was asked.
#[derive(Default)]
struct Times(BTreeMap<&'static str, Vec<Duration>>);

impl Times {
    fn ask(&mut self, client: &mut Client, path: &Path, at: &Value) {
        for (method, params) in questions(path, at) {
            let started = Instant::now();
            client.ask(method, params);
            self.0.entry(method).or_default().push(started.elapsed());
        }
    }

    /// A row for each question; how many answers came too late.
    fn tell(self, title: &str) -> usize {
        print(&format!(
            "\n{title}\n\n| asked | answers | median | 99 % | 99.9 % | last | above 100 ms |\n\
             | --- | --- | --- | --- | --- | --- | --- |"
        ));
        let mut late = 0;
        for (method, mut times) in self.0 {
            times.sort();
            let quantile = |share: f64| {
                let at = (share * (times.len() - 1) as f64).round() as usize;
                format!("{:.2} ms", 1e3 * times[at].as_secs_f64())
            };
            let above = times.iter().filter(|time| **time > LIMIT).count();
            late += above;
            let name = method.trim_start_matches("textDocument/");
            let quantiles = [0.5, 0.99, 0.999, 1.0].map(quantile).join(" | ");
            print(&format!(
                "| {name} | {} | {quantiles} | {above} |",
                times.len()
            ));
        }
        late
    }
}

fn main() -> ExitCode {
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    print(&format!("Load when it began: {}", load.trim()));
    let (mut client, mut random) = (Client::new(&[]), Random::new());
    let examples = examples();
    let mut late = 0;

    let mut times = Times::default();
    for k in 0..COUNT {
        let (_, text) = &examples[k % examples.len()];
        let mut ask = |client: &mut Client, path: &Path, at| times.ask(client, path, &at);
        let typed = Typed::truncate(&mut client, &mut random, text, TYPED, &mut ask);
        client.close(&typed.path);
    }
    late += times.tell("Truncated examples");

    let mut times = Times::default();
    for k in 0..COUNT {
        let (_, text) = &examples[k % examples.len()];
        let mut ask = |client: &mut Client, path: &Path, at| times.ask(client, path, &at);
        let mut typed = Typed::open(&mut client, memory("edited.nsd"), text);
        typed.edit(&mut client, &mut random, &mut ask);
        client.close(&typed.path);
    }
    late += times.tell("Edited examples");

    let mut times = Times::default();
    let mut ask = |client: &mut Client, path: &Path, at| times.ask(client, path, &at);
    let mut typed = Typed::open(&mut client, memory("large.nsd"), &large());
    for place in ["  x7' =", "  let y99", "  state x50", "horizon"] {
        let at = typed.text.find(place).expect("it is there");
        typed.write(&mut client, at, "\n  // x7\n  let z = x7 + p7;\n", &mut ask);
    }
    late += times.tell("A text of 500 declarations");

    client.end();
    match late {
        0 => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}
