//! Every page of `nsdc explain` shows a file that gives its code, and one that is right.

use nsdc::diagnostics::explain::{PAGES, examples};
use nsdc::diagnostics::{Diagnostics, render};
use nsdc::expr::Exprs;
use nsdc::nl;
use nsdc::optimize;
use nsdc::project::clock::Clock;
use nsdc::report::Warning;
use nsdc::simulate::{self, Request};
use nsdc::source::SourceMap;
use nsdc::source::imports;
use nsdc::source::imports::{Loaded, Loader, NoFiles, NotLoaded};
use nsdc::syntax::{self, File, Item};
use nsdc::{check, compile};

/// The folder of a page, with an example and the data of the page in it.
struct Beside<'p> {
    example: &'p str,
    page: &'p str,
}

impl Loader for Beside<'_> {
    fn load(&mut self, from: &str, path: &str) -> Result<Loaded, NotLoaded> {
        let key = path.trim_start_matches("./").to_owned();
        let name = format!("{key}.nsd");
        match key == "page" {
            true => Ok(Loaded {
                key,
                name,
                bytes: self.example.as_bytes().to_vec(),
            }),
            false => NoFiles.load(from, path),
        }
    }

    fn data(&mut self, from: &str, path: &str) -> Result<Vec<u8>, NotLoaded> {
        let opening = format!("```csv {path}\n");
        let fence = self.page.split(&opening).nth(1);
        let text = fence.and_then(|rest| rest.split("```").next());
        text.map_or_else(|| NoFiles.data(from, path), |text| Ok(text.into()))
    }
}

/// The codes that a file gives, and the errors as they are shown.
fn diagnose(page: &str, text: &str) -> (Vec<String>, bool, String) {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add("page.nsd", text);
    let mut file = syntax::parse(&source, &mut diags);
    let mut beside = Beside {
        example: text,
        page,
    };
    imports::link(&mut file, "page", &mut beside, &mut sources, &mut diags);
    if !diags.has_errors() {
        check(&file, &sources, &mut diags);
    }
    let mut codes = diags.codes();
    let mut has_errors = diags.has_errors();
    if !has_errors {
        let found = run(&file);
        has_errors = found.iter().any(|code| code.starts_with('E'));
        codes.extend(found);
    }
    (codes, has_errors, render(&diags, &sources, false, 80))
}

/// The codes that its experiments give when they are run.
fn run(file: &File) -> Vec<String> {
    let mut codes = Vec::new();
    for item in &file.items {
        let Item::Experiment(experiment) = item else {
            continue;
        };
        let exprs = Exprs::new();
        let (mut clock, mut diags) = (Clock::default(), Diagnostics::new());
        if let Some(compiled) = compile(&exprs, file, experiment, &[], &mut clock, &mut diags) {
            let request = Request::default();
            let (system, settings) = (&compiled.system, &compiled.settings);
            let trajectory = match &settings.optimize {
                None => simulate::run(system, settings, &request),
                Some(task) => match optimize::run(system, settings, task, &[], &request, &mut ()) {
                    Ok(solved) => solved.trajectory,
                    Err(error) => {
                        codes.push(Warning::of(&optimize::refused(&error, settings)).code);
                        continue;
                    }
                },
            };
            let failure = trajectory
                .failure
                .iter()
                .map(|failure| Warning::of(failure));
            let found = trajectory.warnings.iter().cloned().chain(failure);
            codes.extend(found.map(|warning| warning.code));
        }
    }
    codes
}

/// Applies `judge` to all examples of a kind, and shows all that it finds.
fn for_all(language: &str, word: &str, judge: impl Fn(&str, &str, &str) -> Option<String>) {
    let examples = PAGES.iter().flat_map(|(code, page)| {
        examples(page, language, word)
            .into_iter()
            .map(move |text| (code, page, text))
    });
    let found: Vec<String> = examples
        .filter_map(|(code, page, text)| judge(code, page, text))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn wrong_examples_give_the_code() {
    for_all("nsd", "wrong", |code, page, text| {
        let (codes, _, shown) = diagnose(page, text);
        let is_given = codes.iter().any(|got| got == code);
        (!is_given).then(|| format!("{code}: got {codes:?}\n{text}\n{shown}"))
    });
}

#[test]
fn right_examples_have_no_errors() {
    for_all("nsd", "right", |code, page, text| {
        let (_, has_errors, shown) = diagnose(page, text);
        has_errors.then(|| format!("{code}:\n{text}\n{shown}"))
    });
}

/// The codes that a problem file gives.
fn diagnose_nl(text: &str) -> Vec<String> {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    nl::read("page.nl", text.into(), &mut sources, &mut diags);
    diags.codes()
}

#[test]
fn wrong_problem_files_give_the_code() {
    for_all("nl", "wrong", |code, _, text| {
        let codes = diagnose_nl(text);
        (codes != [code]).then(|| format!("{code}: got {codes:?}\n{text}"))
    });
}

#[test]
fn right_problem_files_have_no_errors() {
    for_all("nl", "right", |code, _, text| {
        let codes = diagnose_nl(text);
        (!codes.is_empty()).then(|| format!("{code}: got {codes:?}\n{text}"))
    });
}
