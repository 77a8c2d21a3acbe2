//! Experiments: their settings and expectations.

use nsd_grammar::Rule;
use pest::iterators::Pair;

use super::recover::Place;
use super::{Builder, Parts, parts};
use crate::source::Span;
use crate::syntax::ast::*;

/// What a member of a `guess` or an `initial` may be.
enum Member<A, B> {
    Marked(A),
    Plain(B),
    Bad,
}

impl Builder<'_> {
    pub(super) fn experiment(&mut self, mut parts: Parts, span: Span) -> Experiment {
        let kind = match parts.one(Rule::experiment_kind).as_str() {
            "simulate" => ExperimentKind::Simulate,
            _ => ExperimentKind::Optimize,
        };
        let name = self.ident(parts.one(Rule::name));
        let model = self.path(parts.one(Rule::path));
        let mut settings = Vec::new();
        for pair in parts {
            let bad = |span| ExperimentSetting {
                kind: SettingKind::Bad,
                span,
            };
            self.member(
                pair,
                Place::Experiment,
                Builder::setting,
                bad,
                &mut settings,
            );
        }
        Experiment {
            kind,
            name,
            model,
            settings,
            open: Vec::new(),
            span,
        }
    }

    fn setting(&mut self, pair: Pair<Rule>) -> ExperimentSetting {
        let span = self.span(&pair);
        let kind = self.setting_kind(pair);
        ExperimentSetting { kind, span }
    }

    fn setting_kind(&mut self, pair: Pair<Rule>) -> SettingKind {
        let rule = pair.as_rule();
        let mut parts = parts(pair);
        match rule {
            Rule::with => SettingKind::With(self.binds(parts.one(Rule::binds))),
            Rule::guess => self.guess(parts),
            Rule::method => SettingKind::Method {
                name: self.ident(parts.one(Rule::name)),
                options: parts
                    .maybe(Rule::options)
                    .map(|options| self.options(options))
                    .unwrap_or_default(),
            },
            Rule::horizon => self.horizon(parts),
            Rule::record => SettingKind::Output {
                paths: self.paths(&mut parts),
                when: self.output_when(parts),
            },
            Rule::lower => SettingKind::Lower(parts.map(|name| self.ident(name)).collect()),
            Rule::subject_to => SettingKind::SubjectTo {
                rows: self.rows(parts.one(Rule::rows)),
                at: parts.maybe(Rule::name).map(|name| self.ident(name)),
            },
            Rule::final_rows => SettingKind::Final(self.rows(parts.one(Rule::rows))),
            Rule::initial => self.initial(parts),
            Rule::free => {
                let mut list = Vec::new();
                for pair in parts {
                    let build =
                        |builder: &mut Self, pair: Pair<Rule>| Some(builder.free_path(pair));
                    self.member(pair, Place::Free, build, |_| None, &mut list);
                }
                SettingKind::Free(list.into_iter().flatten().collect())
            }
            Rule::perturb => SettingKind::Perturb {
                every: self.expr(parts.one(Rule::expr)),
                by: self.behind(&mut parts, Rule::by),
                seed: self.behind(&mut parts, Rule::seed),
            },
            Rule::starts => SettingKind::Starts {
                count: self.expr(parts.one(Rule::expr)),
                by: self.behind(&mut parts, Rule::by),
                seed: self.behind(&mut parts, Rule::seed),
            },
            Rule::on_chattering => SettingKind::OnChattering,
            Rule::value => SettingKind::Value {
                name: self.ident(parts.one(Rule::value_name)),
                value: self.expr(parts.one(Rule::expr)),
            },
            Rule::expect => SettingKind::Expect(self.expect(parts)),
            rule => unreachable!("grammar: {rule:?} is no setting"),
        }
    }

    fn guess(&mut self, parts: Parts) -> SettingKind {
        let mut list = Vec::new();
        let build = |builder: &mut Self, pair: Pair<Rule>| match pair.as_rule() {
            Rule::guess_from => Member::Marked(builder.guess_source(pair)),
            _ => Member::Plain(builder.bind(pair)),
        };
        for pair in parts {
            self.member(pair, Place::Guess, build, |_| Member::Bad, &mut list);
        }
        let (from, binds) = divide(list);
        SettingKind::Guess { from, binds }
    }

    fn guess_source(&mut self, pair: Pair<Rule>) -> GuessSource {
        let mut parts = parts(pair);
        match parts.maybe(Rule::string) {
            Some(file) => {
                GuessSource::File(file.as_str().trim_matches('"').to_owned(), self.span(&file))
            }
            None => GuessSource::Experiment(self.path(parts.one(Rule::path))),
        }
    }

    fn horizon(&mut self, mut parts: Parts) -> SettingKind {
        let free = parts.maybe(Rule::horizon_free);
        let is_free = free.is_some();
        let mut parts = free.map_or(parts, self::parts);
        SettingKind::Horizon {
            free: is_free,
            range: parts
                .maybe(Rule::interval)
                .map(|range| self.interval(range)),
            value: parts.maybe(Rule::expr).map(|value| self.expr(value)),
        }
    }

    fn paths(&mut self, parts: &mut Parts) -> Vec<Path> {
        let mut paths = Vec::new();
        while let Some(path) = parts.maybe(Rule::path) {
            paths.push(self.path(path));
        }
        paths
    }

    fn output_when(&mut self, mut parts: Parts) -> OutputWhen {
        if let Some(every) = self.behind(&mut parts, Rule::every) {
            return OutputWhen::Every(every);
        }
        self.behind(&mut parts, Rule::at)
            .map_or(OutputWhen::Method, OutputWhen::At)
    }

    fn initial(&mut self, parts: Parts) -> SettingKind {
        let mut list = Vec::new();
        let build = |builder: &mut Self, pair: Pair<Rule>| match pair.as_rule() {
            Rule::initial_free => Member::Marked(builder.free_path(pair)),
            _ => Member::Plain(builder.row(pair)),
        };
        for pair in parts {
            self.member(pair, Place::Initial, build, |_| Member::Bad, &mut list);
        }
        let (free, rows) = divide(list);
        SettingKind::Initial { free, rows }
    }

    fn free_path(&mut self, pair: Pair<Rule>) -> (Path, Option<Domain>) {
        let mut parts = parts(pair);
        let path = self.path(parts.one(Rule::path));
        (
            path,
            parts.maybe(Rule::domain).map(|domain| self.domain(domain)),
        )
    }

    /// The expression behind a word: `by`, `seed`, `every`, `at`, `within`.
    fn behind(&mut self, parts: &mut Parts, rule: Rule) -> Option<Expr> {
        let inner = self::parts(parts.maybe(rule)?).next()?;
        let span = self.span(&inner);
        Some(match inner.as_rule() {
            Rule::number => Expr {
                kind: ExprKind::Number(inner.as_str().parse().unwrap_or(f64::NAN)),
                span,
            },
            _ => self.expr(inner),
        })
    }

    fn expect(&mut self, mut parts: Parts) -> Expect {
        let pair = parts.next().expect("grammar: `expect` states something");
        let rule = pair.as_rule();
        let mut parts = self::parts(pair);
        match rule {
            Rule::expect_golden => Expect::LoweringGolden,
            Rule::expect_numbers => Expect::NumbersGolden,
            Rule::expect_mode => Expect::Mode {
                at: self.expr(parts.one(Rule::arith)),
                mode: self.expr(parts.one(Rule::expr)),
            },
            Rule::expect_status => Expect::Status(self.ident(parts.one(Rule::name))),
            Rule::expect_warning => Expect::Warning(self.ident(parts.one(Rule::name))),
            _ => {
                let left = self.expr(parts.one(Rule::arith));
                let always = parts.maybe(Rule::always).map(|_| ExpectWhen::Always);
                let at = self.behind(&mut parts, Rule::instant).map(ExpectWhen::At);
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
                    right: self.expr(parts.one(Rule::arith)),
                    right_at: self.behind(&mut parts, Rule::instant),
                    within: self.behind(&mut parts, Rule::within),
                }))
            }
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
