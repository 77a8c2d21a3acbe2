//! The walk of [`super::references`] through the settings of an experiment.

use super::index::Role;
use super::references::Resolver;
use super::words::Worded;
use crate::syntax::{
    Arg, Domain, Expect, ExpectWhen, Experiment, Expr, ExprKind, GuessSource, Item, OutputWhen,
    Path, PlotItem, PlotKind, SettingKind,
};

/// `plain(2)`, of words that `elements` takes.
fn is_plain(value: &Expr) -> bool {
    let head = match &value.kind {
        ExprKind::Call(head, _) => head,
        _ => value,
    };
    matches!(&head.kind, ExprKind::Name(name) if name == "plain")
}

/// Settings, whose names are those of the model and of the file of the experiment.
pub(super) struct Settings<'s, 'r, 'f> {
    pub resolver: &'s mut Resolver<'r, 'f>,
}

impl<'r, 'f> Settings<'_, 'r, 'f> {
    /// The settings of an experiment.
    pub fn read(&mut self, experiment: &'f Experiment) {
        for setting in &experiment.settings {
            match &setting.kind {
                SettingKind::With(binds) => self.resolver.binds(binds),
                SettingKind::Horizon { value, range, .. } => {
                    self.resolver.exprs(value);
                    self.resolver
                        .exprs(range.iter().flat_map(|(low, high)| [low, high]));
                }
                SettingKind::Output { when, paths } => {
                    for path in paths {
                        self.resolver.path(path, None, Role::Reads);
                    }
                    if let OutputWhen::Every(instants) | OutputWhen::At(instants) = when {
                        self.resolver.expr(instants);
                    }
                }
                SettingKind::Sensitivity { to, .. } => {
                    for (path, _) in to {
                        self.resolver.path(path, None, Role::Reads);
                    }
                }
                SettingKind::Data(data) => {
                    self.resolver
                        .binds(data.with.as_deref().unwrap_or_default());
                    for measured in &data.columns {
                        self.resolver.path(&measured.path, None, Role::Reads);
                        self.resolver.exprs(&measured.weight);
                    }
                }
                SettingKind::Perturb {
                    every: count,
                    by,
                    seed,
                }
                | SettingKind::Starts { count, by, seed } => {
                    self.resolver.expr(count);
                    // A distribution.
                    by.iter().for_each(|by| self.worded().word(by));
                    self.resolver.exprs(seed);
                }
                SettingKind::Plot(items) | SettingKind::Animate(items) => {
                    self.plot_items(items);
                }
                SettingKind::Method { options, .. } => self.worded().options(options),
                SettingKind::SubjectTo { rows, soft, .. } | SettingKind::Final { rows, soft } => {
                    self.resolver.rows(rows);
                    self.resolver.exprs(soft.iter().map(|soft| &soft.weight));
                }
                SettingKind::Initial { free, rows } => {
                    self.free(free);
                    self.resolver.rows(rows);
                }
                SettingKind::Free(free) => self.free(free),
                SettingKind::Guess { from, binds } => {
                    self.guess_sources(from);
                    self.resolver.binds(binds);
                }
                // Their values are words of the language.
                SettingKind::Value { name, .. } if matches!(&*name.name, "controls" | "scheme") => {
                }
                SettingKind::Value { name, value }
                    if name.name == "loss" || name.name == "elements" && is_plain(value) =>
                {
                    self.worded().word(value);
                }
                SettingKind::Value { value, .. } | SettingKind::FreeIntervals(value) => {
                    self.resolver.expr(value);
                }
                SettingKind::Expect(expect) => {
                    self.resolver.of_runs = &["switches", "end"];
                    self.expect(expect);
                    self.resolver.of_runs = &[];
                }
                SettingKind::Controller(path) => self.experiment(path),
                SettingKind::Stop(condition) => self.resolver.expr(condition),
                SettingKind::Lower(_) | SettingKind::OnChattering | SettingKind::Bad => {}
            }
        }
    }

    fn worded(&mut self) -> Worded<'_, 'r, 'f> {
        Worded {
            resolver: self.resolver,
        }
    }

    fn free(&mut self, free: &'f [(Path, Option<Domain>)]) {
        for (path, domain) in free {
            self.resolver.path(path, None, Role::Sets);
            self.resolver.domain(domain.as_ref());
        }
    }

    fn guess_sources(&mut self, sources: &'f [GuessSource]) {
        for source in sources {
            if let GuessSource::Experiment(path) = source {
                self.experiment(path);
            }
        }
    }

    /// An experiment of the file that is named.
    fn experiment(&mut self, path: &'f Path) {
        let mut items = self.resolver.file.file.items.iter();
        let declared = items.find_map(|item| match item {
            Item::Experiment(known) if known.name.name == path.head.name => Some(known.name.span),
            _ => None,
        });
        self.resolver
            .take_down(path.head.span, declared, Role::Reads);
    }

    fn expect(&mut self, expect: &'f Expect) {
        match expect {
            Expect::Mode { at, mode } => {
                self.resolver.expr(at);
                self.mode(mode);
            }
            Expect::Relation(relation) => {
                if let ExpectWhen::At(at) = &relation.when {
                    self.resolver.expr(at);
                }
                self.resolver.exprs([&relation.left, &relation.right]);
                self.resolver
                    .exprs(relation.right_at.iter().chain(&relation.within));
            }
            Expect::LoweringGolden | Expect::NumbersGolden => {}
            Expect::Status(_) | Expect::Warning(_) => {}
        }
    }

    /// Regions and surfaces, in `sliding(s)` and the like.
    fn mode(&mut self, mode: &'f Expr) {
        if self.resolver.recorder.is_none() {
            return;
        }
        match &mode.kind {
            ExprKind::Call(_, args) => {
                for arg in args {
                    if let Arg::Positional(surface, _) = arg {
                        self.resolver.expr(surface);
                    }
                }
            }
            ExprKind::And(_) | ExprKind::Or(_) | ExprKind::Not(_) => {
                mode.each(&mut |part| self.mode(part));
            }
            _ => self.resolver.expr(mode),
        }
    }

    fn plot_items(&mut self, items: &'f [PlotItem]) {
        for item in items {
            self.resolver.exprs(item.kind.exprs());
            if let PlotKind::For(binders, items) = &item.kind {
                self.resolver.under(binders, item.span, |resolver| {
                    Settings { resolver }.plot_items(items);
                });
            }
        }
    }
}
