//! What may stand in an experiment.

use lsp_types::{CompletionItem, CompletionItemKind};

use nsd_grammar::Rule;

use super::super::around::Around;
use super::super::reference;
use super::{Known, choices, codes, item, words};
use crate::model::hir::reserved::VALUES;
use crate::model::index::Kind;
use crate::report::Status;
use crate::syntax::{EXPECTATIONS, ExperimentKind, Place, SettingKind, Sliding, TokenKind, starts};
use crate::system::experiment::{Lowering, MethodKind, OPTIMIZER, options_of, words_of, written};

/// What an expectation may begin with besides, of what a run has as numbers.
const OF_RUNS: [&str; 4] = ["switches", "events", "order", "objective"];

impl Known<'_> {
    /// What may stand in an experiment.
    pub(super) fn of_experiment(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        if around.heads.len() > 1 {
            return self.of_block(around);
        }
        match (around.word(0), around.before.len()) {
            ("", _) => settings(around.block()),
            ("method", 1) => {
                let method = |word: &str| {
                    let said = reference::of_method(word);
                    item(word, CompletionItemKind::ENUM_MEMBER, said)
                };
                let methods = match around.block() {
                    "optimize" => vec![OPTIMIZER],
                    "fit" | "mpc" => {
                        let all = MethodKind::ALL.into_iter();
                        let by_events = all.filter(|kind| kind.is_by_events());
                        by_events.map(MethodKind::word).collect()
                    }
                    _ => MethodKind::words(),
                };
                methods.into_iter().map(method).collect()
            }
            ("lower", _) => self.lowerings(around),
            ("on", 1) => words(["chattering slide"]),
            ("stop", 1) => words(["when"]),
            (setting @ ("controls" | "loss" | "scheme"), 1) => self.choices(setting),
            ("subject", _) if around.last() == "at" => self.choices("at"),
            ("subject" | "sensitivity", 1) => words(["to"]),
            ("controller", 1) => {
                let all = self.good.project.experiments();
                let all = all.filter(|known| known.kind == ExperimentKind::Optimize);
                let name = |name: &str| item(name, CompletionItemKind::REFERENCE, None);
                all.map(|known| name(&known.name.name)).collect()
            }
            ("expect", _) => self.expectation(around),
            _ => self.values(),
        }
    }

    /// What may stand in the braces of a setting.
    fn of_block(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        match (around.block(), around.before.is_empty()) {
            ("method", true) => {
                let head = around.heads.last().map_or(&[][..], Vec::as_slice);
                let method = head.get(1).map_or("", |token| token.text);
                let option = |name: &&str| {
                    let said = reference::of_option(method, name);
                    item(name, CompletionItemKind::PROPERTY, said)
                };
                options_of(method).iter().map(option).collect()
            }
            ("method", false) => self.choices(around.word(0)),
            ("plot", true) => {
                let begin = words(starts(Place::Plot).iter().map(|(word, _)| *word));
                begin.into_iter().chain(self.values()).collect()
            }
            ("with", false) if around.ends_with(&[".", "sliding", "="]) => {
                words(Sliding::ALL.map(Sliding::word))
            }
            _ => self.values(),
        }
    }

    /// Lowerings that the method of the experiment takes.
    fn lowerings(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        let name = around.heads[0].get(1).map_or("", |token| token.text);
        let mut experiments = self.good.project.experiments();
        let experiment = experiments.find(|known| known.name.name == name);
        let settings = experiment.into_iter().flat_map(|known| &known.settings);
        let mut methods = settings.filter_map(|setting| match &setting.kind {
            SettingKind::Method { name, .. } => MethodKind::named(&name.name),
            _ => None,
        });
        let method = methods.next().unwrap_or(MethodKind::Auto);
        let is_optimized = around.block() == "optimize";
        // Reformulations may be asked for by name with any method, as `expect lowering golden` does.
        let takes = |lowering: &Lowering| {
            let is_form = matches!(lowering, Lowering::Stewart | Lowering::Step);
            is_optimized || is_form || method.takes_lowering(*lowering)
        };
        let all = Lowering::ALL.into_iter().filter(takes);
        let of_word = |lowering: Lowering| {
            let said = reference::of_lowering(lowering.word());
            item(lowering.word(), CompletionItemKind::ENUM_MEMBER, said)
        };
        all.map(of_word).collect()
    }

    /// What goes on in an expectation.
    fn expectation(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        let has = |text: &str| around.before.iter().any(|token| token.text == text);
        let instants = || {
            let numbers = self.names(|kind| matches!(kind, Kind::Param | Kind::Constant));
            let values = VALUES.iter().filter(|name| **name == "pi").copied();
            let begin = words(["end"]).into_iter().chain(words(values));
            begin.chain(numbers).collect()
        };
        match (around.word(1), around.before.len()) {
            (_, 1) => {
                let begin = words(EXPECTATIONS.map(|(word, _)| word)).into_iter();
                let begin = begin.chain(words(OF_RUNS));
                begin.chain(self.values()).collect()
            }
            ("warning", 2) => codes('W'),
            ("lowering" | "numbers", 2) => words(["golden"]),
            ("status", 2) => words(["is"]),
            ("status", 3) => words(Status::ALL.map(Status::as_str)),
            ("mode", 2) => words(["at"]),
            _ if around.last() == "at" => instants(),
            _ if around.is_open() || !is_whole(around) => self.values(),
            ("mode", _) if has("is") => words(["and", "or"]),
            ("mode", _) => words(["is"]),
            _ => {
                let is_related = choices(Rule::expect_op).any(has);
                let last_at = around.before.iter().rposition(|token| token.text == "at");
                let relation = around
                    .before
                    .iter()
                    .position(|token| choices(Rule::expect_op).any(|sign| sign == token.text));
                let has_instant = last_at.is_some_and(|at| relation.is_none_or(|k| at > k));
                let mut next = vec![];
                if !has_instant && !has("within") && (is_related || !has("always")) {
                    next.push("at");
                }
                if !is_related && !has_instant && !has("always") {
                    next.push("always");
                }
                if has("~") && !has("within") {
                    next.push("within");
                }
                words(next)
            }
        }
    }

    /// Values of a setting that has words for them, or else any.
    fn choices(&self, setting: &str) -> Vec<CompletionItem> {
        let words = words_of(setting);
        let own = match setting {
            // A function of the file is one, too.
            "law" => self.names(|kind| kind == Kind::Function),
            _ if words.is_empty() => self.values(),
            _ => vec![],
        };
        let word = |word: &String| {
            let said = reference::of_option(setting, word);
            item(&written(word), CompletionItemKind::ENUM_MEMBER, said)
        };
        words.iter().map(word).chain(own).collect()
    }
}

/// Whether an expression may end with what stands in front of the position.
fn is_whole(around: &Around<'_>) -> bool {
    let connects = [
        "expect", "at", "is", "within", "and", "or", "not", "if", "then", "else",
    ];
    around.before.last().is_some_and(|token| match token.kind {
        TokenKind::Word => !connects.contains(&token.text),
        TokenKind::Number => true,
        _ => matches!(token.text, ")" | "]"),
    })
}

/// Settings of a kind of experiment with their meaning.
fn settings(kind: &str) -> Vec<CompletionItem> {
    let of_runs: &[&str] = match kind {
        "simulate" => &[],
        "mpc" => &["lower", "runs", "sensitivity"],
        _ => &["perturb", "on", "runs", "sensitivity", "stop"],
    };
    let sections = match kind {
        "optimize" => &[reference::OPTIMIZE, reference::SIMULATE][..],
        "fit" => &[reference::FIT, reference::SIMULATE],
        "mpc" => &[reference::MPC, reference::SIMULATE],
        _ => &[reference::SIMULATE],
    };
    let said = |word: &str| {
        let mut said = sections
            .iter()
            .filter_map(|section| reference::of_statement(section, word));
        said.next()
    };
    let all = starts(Place::Experiment).iter().map(|(word, _)| *word);
    let all =
        all.filter(|word| !of_runs.contains(word) && said(word).is_some() || *word == "expect");
    all.map(|word| item(word, CompletionItemKind::KEYWORD, said(word)))
        .collect()
}
