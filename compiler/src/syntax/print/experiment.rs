//! Experiments.

use super::expression::arith;
use super::statement::domain;
use super::{Printer, list};
use crate::syntax::ast::*;
use crate::syntax::build::words::RESERVED;

impl Printer {
    pub(super) fn experiment(&mut self, item: &Experiment) {
        let word = item.kind.word();
        self.block(
            format!("{word} {} of {}", item.name, item.model),
            "",
            |printer| {
                item.settings
                    .iter()
                    .for_each(|setting| printer.setting(setting));
            },
        );
    }

    fn setting(&mut self, setting: &ExperimentSetting) {
        match &setting.kind {
            SettingKind::With(binds) => self.block("with", "", |printer| printer.binds(binds, "=")),
            SettingKind::Guess { from, binds } => self.block("guess", "", |printer| {
                for source in from {
                    match source {
                        GuessSource::Experiment(path) => printer.line(format!("from {path};")),
                        GuessSource::File(file, _) => printer.line(format!("from \"{file}\";")),
                    }
                }
                printer.binds(binds, "=");
            }),
            SettingKind::Method { name, options } => match options.is_empty() {
                true => self.line(format!("method {name};")),
                false => self.block(format!("method {name}"), "", |printer| {
                    printer.options(options)
                }),
            },
            SettingKind::Horizon { free, range, value } => {
                let range = range
                    .as_ref()
                    .map(|(lower, upper)| format!(" in [{lower}, {upper}]"));
                let free = if *free { " free" } else { "" };
                let equals = if free.is_empty() { " " } else { " = " };
                let value = value.as_ref().map(|value| format!("{equals}{value}"));
                let range = range.unwrap_or_default();
                self.line(format!(
                    "horizon{free}{range}{};",
                    value.unwrap_or_default()
                ));
            }
            SettingKind::Output { paths, when } => {
                let when = match when {
                    OutputWhen::Method => String::new(),
                    OutputWhen::Every(period) => format!(" every {period}"),
                    OutputWhen::At(instants) => format!(" at {instants}"),
                };
                let space = if paths.is_empty() { "" } else { " " };
                self.line(format!("output{space}{}{when};", list(paths)));
            }
            SettingKind::Lower(names) => self.line(format!("lower {};", list(names))),
            SettingKind::SubjectTo { rows, at, soft } => {
                let at = at.as_ref().map(|at| format!(" at {at}"));
                self.constraints("subject to", rows, at, soft);
            }
            SettingKind::Final { rows, soft } => self.constraints("final", rows, None, soft),
            SettingKind::Initial { free, rows } => self.block("initial", "", |printer| {
                for (path, range) in free {
                    printer.line(format!("{path} free{};", domain(range)));
                }
                printer.rows(rows);
            }),
            SettingKind::Free(free) => self.block("free", "", |printer| {
                for (path, range) in free {
                    printer.line(format!("{path}{};", domain(range)));
                }
            }),
            SettingKind::Perturb { every, by, seed } => {
                self.line(format!("perturb every {every}{};", random(by, seed)));
            }
            SettingKind::Starts { count, by, seed } => {
                self.line(format!("starts {count}{};", random(by, seed)))
            }
            SettingKind::FreeIntervals(count) => self.line(format!("intervals {count} free;")),
            SettingKind::OnChattering => self.line("on chattering slide;".to_owned()),
            SettingKind::Stop(condition) => self.line(format!("stop when {condition};")),
            SettingKind::Sensitivity { to, one_sided } => self.sensitivity(to, *one_sided),
            SettingKind::Data(data) => self.data(data),
            SettingKind::Controller(path) => self.line(format!("controller {path};")),
            SettingKind::Plot(items) => self.plot("plot", items),
            SettingKind::Animate(items) => self.plot("animate", items),
            SettingKind::Value { name, value } => self.line(format!("{name} {value};")),
            SettingKind::Expect(expect) => self.line(format!("expect {};", expectation(expect))),
            SettingKind::Bad => self.bad(),
        }
    }

    fn constraints(&mut self, head: &str, rows: &[Row], at: Option<String>, soft: &Option<Soft>) {
        let soft = soft.as_ref();
        let soft = soft.map(|Soft { norm, weight }| format!(" soft {norm} weight {weight}"));
        let words: Vec<String> = at.into_iter().chain(soft).collect();
        let end = if words.is_empty() { "" } else { ";" };
        self.block(head, &(words.concat() + end), |printer| printer.rows(rows));
    }

    fn sensitivity(&mut self, to: &[(Path, bool)], one_sided: bool) {
        let to = to.iter().map(|(path, at_start)| match at_start {
            true => format!("{path} at 0"),
            false => path.to_string(),
        });
        let sides = if one_sided { " one_sided" } else { "" };
        let to = list(&to.collect::<Vec<_>>());
        self.line(format!("sensitivity to {to}{sides};"));
    }

    fn data(&mut self, data: &Data) {
        let with = data.with.as_ref().map(|binds| {
            let binds = binds.iter();
            let binds = binds.map(|bind| format!("{} = {}; ", bind.target, bind.value));
            format!(" with {{ {}}}", binds.collect::<String>())
        });
        let head = format!("data \"{}\"{}", data.file, with.unwrap_or_default());
        self.block(head, "", |printer| {
            for Measured {
                path,
                column,
                weight,
                ..
            } in &data.columns
            {
                let weight = weight.as_ref().map(|weight| format!(" weight {weight}"));
                let weight = weight.unwrap_or_default();
                printer.line(format!("{path} -> {}{weight};", quoted(&column.name)));
            }
        });
    }

    fn plot(&mut self, word: &str, items: &[PlotItem]) {
        self.block(word, "", |printer| {
            for item in items {
                printer.plot_item(&item.kind);
            }
        });
    }

    fn plot_item(&mut self, item: &PlotKind) {
        match item {
            PlotKind::Panel(exprs) => self.line(format!("{};", list(exprs))),
            PlotKind::Phase(axes) => self.line(phase(axes)),
            PlotKind::Drawing(word, exprs) => self.line(format!("{} {};", word.name, list(exprs))),
            PlotKind::For(binders, items) => {
                self.plot(
                    &format!("for {}", super::expression::binders(binders)),
                    items,
                );
            }
            PlotKind::Title(title) => self.line(format!("title \"{title}\";")),
            PlotKind::Width(number, unit) => {
                self.line(format!("width {number} {};", unit.as_str()));
            }
            PlotKind::Bad => self.bad(),
        }
    }
}

/// A first axis that begins with a sign stands in parentheses, as `phase - x` is a difference.
fn phase([x, y]: &[Expr; 2]) -> String {
    let x = x.to_string();
    match x.starts_with('-') {
        true => format!("phase ({x}), {y};"),
        false => format!("phase {x}, {y};"),
    }
}

/// The name of a column, in quotes where it is no name of the language.
fn quoted(column: &str) -> String {
    let is_start = |c: char| c == '_' || c.is_ascii_alphabetic();
    let is_plain = column.starts_with(is_start)
        && column
            .chars()
            .all(|c| c == '_' || c.is_ascii_alphanumeric())
        && !RESERVED.contains(&column);
    match is_plain {
        true => column.to_owned(),
        false => format!("\"{column}\""),
    }
}

fn random(by: &Option<Expr>, seed: &Option<Expr>) -> String {
    let by = by.as_ref().map(|by| format!(" by {by}"));
    let seed = seed.as_ref().map(|seed| format!(" seed {seed}"));
    by.unwrap_or_default() + &seed.unwrap_or_default()
}

fn expectation(expect: &Expect) -> String {
    let relation = match expect {
        Expect::LoweringGolden => return "lowering golden".to_owned(),
        Expect::NumbersGolden => return "numbers golden".to_owned(),
        Expect::Mode { at, mode } => return format!("mode at {} is {mode}", arith(at)),
        Expect::Status(status) => return format!("status is {status}"),
        Expect::Warning(code) => return format!("warning {code}"),
        Expect::Relation(relation) => relation,
    };
    let when = match &relation.when {
        ExpectWhen::Run => String::new(),
        ExpectWhen::At(instant) => format!(" at {}", arith(instant)),
        ExpectWhen::Always => " always".to_owned(),
    };
    let operator = match relation.relation {
        ExpectOp::Close => "~",
        ExpectOp::Equal => "=",
        ExpectOp::Less => "<",
        ExpectOp::LessEqual => "<=",
        ExpectOp::Greater => ">",
        ExpectOp::GreaterEqual => ">=",
    };
    let behind = |word: &str, value: &Option<Expr>| {
        let value = value
            .as_ref()
            .map(|value| format!(" {word} {}", arith(value)));
        value.unwrap_or_default()
    };
    format!(
        "{}{when} {operator} {}{}{}",
        arith(&relation.left),
        arith(&relation.right),
        behind("at", &relation.right_at),
        behind("within", &relation.within)
    )
}
