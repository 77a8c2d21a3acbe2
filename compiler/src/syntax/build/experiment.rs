//! Experiments: their settings and expectations.

use nsd_grammar::Rule;
use pest::iterators::Pair;

use super::expression::{expr, path};
use super::reading::{Parts, Reading, parts};
use super::statement::{bind, binders, binds, domain, interval, members, options, row, rows};
use super::words::Place;
use crate::source::Span;
use crate::syntax::ast::*;

/// What a member of a `guess` or an `initial` may be.
enum Member<A, B> {
    Marked(A),
    Plain(B),
    Bad,
}

pub(crate) fn experiment(reading: &mut Reading, mut parts: Parts, span: Span) -> Experiment {
    let kind = match parts.one(Rule::experiment_kind).as_str() {
        "simulate" => ExperimentKind::Simulate,
        "optimize" => ExperimentKind::Optimize,
        "fit" => ExperimentKind::Fit,
        _ => ExperimentKind::Mpc,
    };
    let name = reading.ident(parts.one(Rule::name));
    let model = path(reading, parts.one(Rule::path));
    let bad = |span| ExperimentSetting {
        kind: SettingKind::Bad,
        span,
    };
    let settings = members(reading, parts, Place::Experiment, setting, bad);
    Experiment {
        kind,
        name,
        model,
        settings,
        open: Vec::new(),
        differentiates: false,
        measures: None,
        span,
    }
}

fn setting(reading: &mut Reading, pair: Pair<Rule>) -> ExperimentSetting {
    let span = reading.span(&pair);
    let kind = setting_kind(reading, pair);
    ExperimentSetting { kind, span }
}

fn setting_kind(reading: &mut Reading, pair: Pair<Rule>) -> SettingKind {
    let rule = pair.as_rule();
    let mut parts = parts(pair);
    match rule {
        Rule::with => SettingKind::With(binds(reading, parts.one(Rule::binds))),
        Rule::guess => guess(reading, parts),
        Rule::method => SettingKind::Method {
            name: reading.ident(parts.one(Rule::name)),
            options: parts
                .maybe(Rule::options)
                .map(|pair| options(reading, pair))
                .unwrap_or_default(),
        },
        Rule::horizon => horizon(reading, parts),
        Rule::record => SettingKind::Output {
            paths: paths(reading, &mut parts),
            when: output_when(reading, parts),
        },
        Rule::lower => SettingKind::Lower(parts.map(|name| reading.ident(name)).collect()),
        Rule::subject_to => SettingKind::SubjectTo {
            rows: rows(reading, parts.one(Rule::rows)),
            at: parts.maybe(Rule::name).map(|name| reading.ident(name)),
            soft: soft(reading, &mut parts),
        },
        Rule::final_rows => SettingKind::Final {
            rows: rows(reading, parts.one(Rule::rows)),
            soft: soft(reading, &mut parts),
        },
        Rule::initial => initial(reading, parts),
        Rule::free => {
            let build = |reading: &mut Reading, pair: Pair<Rule>| Some(free_path(reading, pair));
            let list = members(reading, parts, Place::Free, build, |_| None);
            SettingKind::Free(list.into_iter().flatten().collect())
        }
        Rule::perturb => SettingKind::Perturb {
            every: expr(reading, parts.one(Rule::expr)),
            by: behind(reading, &mut parts, Rule::by),
            seed: behind(reading, &mut parts, Rule::seed),
        },
        Rule::starts => SettingKind::Starts {
            count: expr(reading, parts.one(Rule::expr)),
            by: behind(reading, &mut parts, Rule::by),
            seed: behind(reading, &mut parts, Rule::seed),
        },
        Rule::on_chattering => SettingKind::OnChattering,
        Rule::stop => SettingKind::Stop(expr(reading, parts.one(Rule::expr))),
        Rule::sensitivity => {
            let mut to = Vec::new();
            while let Some(pair) = parts.maybe(Rule::sensed) {
                to.push(sensed(reading, pair));
            }
            SettingKind::Sensitivity {
                to,
                one_sided: parts.maybe(Rule::one_sided).is_some(),
            }
        }
        Rule::data => data(reading, parts),
        Rule::controller => SettingKind::Controller(path(reading, parts.one(Rule::path))),
        Rule::plot => SettingKind::Plot(plot_items(reading, parts, Place::Plot)),
        Rule::animate => SettingKind::Animate(plot_items(reading, parts, Place::Animation)),
        Rule::free_intervals => SettingKind::FreeIntervals(expr(reading, parts.one(Rule::expr))),
        Rule::value => SettingKind::Value {
            name: reading.ident(parts.one(Rule::value_name)),
            value: expr(reading, parts.one(Rule::expr)),
        },
        Rule::expect => SettingKind::Expect(expect(reading, parts)),
        rule => unreachable!("grammar: {rule:?} is no setting"),
    }
}

fn soft(reading: &mut Reading, parts: &mut Parts) -> Option<Soft> {
    let mut parts = self::parts(parts.maybe(Rule::soft)?);
    Some(Soft {
        norm: reading.ident(parts.one(Rule::name)),
        weight: behind(reading, &mut parts, Rule::weight)?,
    })
}

fn guess(reading: &mut Reading, parts: Parts) -> SettingKind {
    let build = |reading: &mut Reading, pair: Pair<Rule>| match pair.as_rule() {
        Rule::guess_from => Member::Marked(guess_source(reading, pair)),
        _ => Member::Plain(bind(reading, pair)),
    };
    let (from, binds) = divide(members(reading, parts, Place::Guess, build, |_| {
        Member::Bad
    }));
    SettingKind::Guess { from, binds }
}

fn guess_source(reading: &mut Reading, pair: Pair<Rule>) -> GuessSource {
    let mut parts = parts(pair);
    match parts.maybe(Rule::string) {
        Some(file) => GuessSource::File(unquoted(&file).to_owned(), reading.span(&file)),
        None => GuessSource::Experiment(path(reading, parts.one(Rule::path))),
    }
}

fn horizon(reading: &mut Reading, mut parts: Parts) -> SettingKind {
    let free = parts.maybe(Rule::horizon_free);
    let is_free = free.is_some();
    let mut parts = free.map_or(parts, self::parts);
    SettingKind::Horizon {
        free: is_free,
        range: parts
            .maybe(Rule::interval)
            .map(|range| interval(reading, range)),
        value: parts.maybe(Rule::expr).map(|value| expr(reading, value)),
    }
}

fn data(reading: &mut Reading, mut parts: Parts) -> SettingKind {
    let file = parts.one(Rule::string);
    let (name, span) = (unquoted(&file).to_owned(), reading.span(&file));
    let with = parts.maybe(Rule::binds).map(|with| binds(reading, with));
    let build = |reading: &mut Reading, pair: Pair<Rule>| Some(measured(reading, pair));
    let columns = members(reading, parts, Place::Data, build, |_| None);
    SettingKind::Data(Data {
        file: name,
        span,
        with,
        columns: columns.into_iter().flatten().collect(),
    })
}

fn measured(reading: &mut Reading, pair: Pair<Rule>) -> Measured {
    let span = reading.span(&pair);
    let mut parts = parts(pair);
    let path = path(reading, parts.one(Rule::path));
    let column = match parts.maybe(Rule::name) {
        Some(name) => reading.ident(name),
        None => {
            let string = parts.one(Rule::string);
            Ident {
                name: unquoted(&string).to_owned(),
                span: reading.span(&string),
            }
        }
    };
    Measured {
        path,
        column,
        weight: behind(reading, &mut parts, Rule::weight),
        span,
    }
}

/// A parameter, or a state with `at 0`.
fn sensed(reading: &mut Reading, pair: Pair<Rule>) -> (Path, bool) {
    let mut parts = parts(pair);
    let path = path(reading, parts.one(Rule::path));
    (path, parts.maybe(Rule::at_start).is_some())
}

fn paths(reading: &mut Reading, parts: &mut Parts) -> Vec<Path> {
    let mut paths = Vec::new();
    while let Some(pair) = parts.maybe(Rule::path) {
        paths.push(path(reading, pair));
    }
    paths
}

fn output_when(reading: &mut Reading, mut parts: Parts) -> OutputWhen {
    if let Some(every) = behind(reading, &mut parts, Rule::every) {
        return OutputWhen::Every(every);
    }
    behind(reading, &mut parts, Rule::at).map_or(OutputWhen::Method, OutputWhen::At)
}

fn initial(reading: &mut Reading, parts: Parts) -> SettingKind {
    let build = |reading: &mut Reading, pair: Pair<Rule>| match pair.as_rule() {
        Rule::initial_free => Member::Marked(free_path(reading, pair)),
        _ => Member::Plain(row(reading, pair)),
    };
    let (free, rows) = divide(members(reading, parts, Place::Initial, build, |_| {
        Member::Bad
    }));
    SettingKind::Initial { free, rows }
}

fn free_path(reading: &mut Reading, pair: Pair<Rule>) -> (Path, Option<Domain>) {
    let mut parts = parts(pair);
    let path = path(reading, parts.one(Rule::path));
    (
        path,
        parts.maybe(Rule::domain).map(|pair| domain(reading, pair)),
    )
}

fn plot_items(reading: &mut Reading, parts: Parts, place: Place) -> Vec<PlotItem> {
    let bad = |span| PlotItem {
        kind: PlotKind::Bad,
        span,
    };
    members(reading, parts, place, plot_item, bad)
}

fn plot_item(reading: &mut Reading, pair: Pair<Rule>) -> PlotItem {
    let (rule, span) = (pair.as_rule(), reading.span(&pair));
    let mut parts = parts(pair);
    let kind = match rule {
        Rule::plot_title => PlotKind::Title(unquoted(&parts.one(Rule::string)).to_owned()),
        Rule::plot_width => {
            let sign = parts.maybe(Rule::negative).map_or(1.0, |_| -1.0);
            let number = parts.one(Rule::number).as_str().parse();
            let unit = match parts.one(Rule::length).as_str() {
                "cm" => Length::Centimetres,
                "mm" => Length::Millimetres,
                _ => Length::Pixels,
            };
            PlotKind::Width(sign * number.unwrap_or(f64::NAN), unit)
        }
        Rule::plot_phase => {
            let axes = [(); 2].map(|()| expr(reading, parts.one(Rule::expr)));
            PlotKind::Phase(Box::new(axes))
        }
        Rule::drawing_for => {
            let binders = binders(reading, &mut parts);
            PlotKind::For(binders, plot_items(reading, parts, Place::Shapes))
        }
        Rule::drawing => {
            let word = reading.ident(parts.one(Rule::name));
            PlotKind::Drawing(word, parts.map(|pair| expr(reading, pair)).collect())
        }
        _ => PlotKind::Panel(parts.map(|pair| expr(reading, pair)).collect()),
    };
    PlotItem { kind, span }
}

/// What stands between the quotes of a string.
fn unquoted<'t>(string: &Pair<'t, Rule>) -> &'t str {
    string.as_str().trim_matches('"')
}

/// The expression behind a word: `by`, `seed`, `every`, `offset`, `at`, `within`.
pub(super) fn behind(reading: &mut Reading, parts: &mut Parts, rule: Rule) -> Option<Expr> {
    let inner = self::parts(parts.maybe(rule)?).next()?;
    let span = reading.span(&inner);
    Some(match inner.as_rule() {
        Rule::number => Expr {
            kind: ExprKind::Number(inner.as_str().parse().unwrap_or(f64::NAN)),
            span,
        },
        _ => expr(reading, inner),
    })
}

fn expect(reading: &mut Reading, mut parts: Parts) -> Expect {
    let pair = parts.next().expect("grammar: `expect` states something");
    let rule = pair.as_rule();
    let mut parts = self::parts(pair);
    match rule {
        Rule::expect_golden => Expect::LoweringGolden,
        Rule::expect_numbers => Expect::NumbersGolden,
        Rule::expect_mode => Expect::Mode {
            at: expr(reading, parts.one(Rule::arith)),
            mode: expr(reading, parts.one(Rule::expr)),
        },
        Rule::expect_status => Expect::Status(reading.ident(parts.one(Rule::name))),
        Rule::expect_warning => Expect::Warning(reading.ident(parts.one(Rule::name))),
        _ => {
            let left = expr(reading, parts.one(Rule::arith));
            let always = parts.maybe(Rule::always).map(|_| ExpectWhen::Always);
            let at = behind(reading, &mut parts, Rule::instant).map(ExpectWhen::At);
            Expect::Relation(Box::new(ExpectRelation {
                left,
                when: always.or(at).unwrap_or(ExpectWhen::Run),
                relation: match parts.one(Rule::expect_op).as_str() {
                    "~" => ExpectOp::Close,
                    "<" => ExpectOp::Less,
                    "<=" => ExpectOp::LessEqual,
                    ">" => ExpectOp::Greater,
                    ">=" => ExpectOp::GreaterEqual,
                    _ => ExpectOp::Equal,
                },
                right: expr(reading, parts.one(Rule::arith)),
                right_at: behind(reading, &mut parts, Rule::instant),
                within: behind(reading, &mut parts, Rule::within),
            }))
        }
    }
}

fn divide<A, B>(list: Vec<Member<A, B>>) -> (Vec<A>, Vec<B>) {
    let mut marked = Vec::new();
    let mut plain = Vec::new();
    for member in list {
        match member {
            Member::Marked(member) => marked.push(member),
            Member::Plain(member) => plain.push(member),
            Member::Bad => {}
        }
    }
    (marked, plain)
}
