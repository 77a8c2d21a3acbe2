//! Words of the language, and what may have been meant by others.

use nsd_grammar::Rule;

/// Which list a wrong member stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Items of a file.
    File,
    /// Statements of a model, a region, ...
    Model,
    /// Settings of an experiment.
    Experiment,
    /// Constraints.
    Rows,
    /// Constraints and freed states of `initial`.
    Initial,
    /// `name = expr;` of a part or a `with`.
    Binds,
    /// `name := expr;` of a jump.
    Resets,
    /// Options of a method or a contact.
    Options,
    /// Options and contacts of `mechanics`.
    Mechanics,
    /// Sources and values of a `guess`.
    Guess,
    /// Parameters of `free`.
    Free,
    /// Columns of `data`.
    Data,
    /// What a `plot` draws.
    Plot,
    /// What an `animate` draws.
    Animation,
    /// Shapes in a loop of an `animate`.
    Shapes,
}

/// Words that cannot be names.
pub const RESERVED: [&str; 10] = [
    "and", "or", "not", "if", "then", "else", "for", "in", "where", "perp",
];

/// Words that start a member of a list, each with its rule.
type Starts = &'static [(&'static str, Rule)];

const FILE: Starts = &[
    ("use", Rule::use_item),
    ("const", Rule::const_item),
    ("fn", Rule::fn_item),
    ("model", Rule::model),
    ("simulate", Rule::experiment),
    ("optimize", Rule::experiment),
    ("fit", Rule::experiment),
    ("mpc", Rule::experiment),
    ("expect", Rule::expect_diagnostic),
];

const MODEL: Starts = &[
    ("const", Rule::const_item),
    ("param", Rule::decl),
    ("state", Rule::decl),
    ("discrete", Rule::decl),
    ("control", Rule::decl),
    ("input", Rule::decl),
    ("algebraic", Rule::decl),
    ("let", Rule::named),
    ("output", Rule::named),
    ("signal", Rule::named),
    ("switch", Rule::switch),
    ("part", Rule::part),
    ("region", Rule::region),
    ("hidden", Rule::hidden),
    ("project", Rule::project),
    ("jump", Rule::jump),
    ("every", Rule::sampled),
    ("mechanics", Rule::mechanics),
    ("contact", Rule::contact),
    ("for", Rule::for_loop),
];

const EXPERIMENT: Starts = &[
    ("with", Rule::with),
    ("horizon", Rule::horizon),
    ("tolerance", Rule::value),
    ("method", Rule::method),
    ("lower", Rule::lower),
    ("output", Rule::record),
    ("perturb", Rule::perturb),
    ("on", Rule::on_chattering),
    ("stop", Rule::stop),
    ("sensitivity", Rule::sensitivity),
    ("data", Rule::data),
    ("loss", Rule::value),
    ("controller", Rule::controller),
    ("sample", Rule::value),
    ("deadline", Rule::value),
    ("runs", Rule::value),
    ("intervals", Rule::value),
    ("elements", Rule::value),
    ("scheme", Rule::value),
    ("grid", Rule::value),
    ("controls", Rule::value),
    ("minimize", Rule::value),
    ("subject", Rule::subject_to),
    ("initial", Rule::initial),
    ("free", Rule::free),
    ("final", Rule::final_rows),
    ("guess", Rule::guess),
    ("starts", Rule::starts),
    ("plot", Rule::plot),
    ("animate", Rule::animate),
    ("expect", Rule::expect),
];

const ANIMATION: Starts = &[
    ("title", Rule::plot_title),
    ("width", Rule::plot_width),
    ("for", Rule::drawing_for),
];

const PLOT: Starts = &[
    ("phase", Rule::plot_phase),
    ("title", Rule::plot_title),
    ("width", Rule::plot_width),
];

/// Words that start members where `place` is.
pub fn starts(place: Place) -> Starts {
    match place {
        Place::File => FILE,
        Place::Model => MODEL,
        Place::Experiment => EXPERIMENT,
        Place::Rows | Place::Initial => &[("for", Rule::row_for)],
        Place::Mechanics => &[("contact", Rule::contact)],
        Place::Guess => &[("from", Rule::guess_from)],
        Place::Plot => PLOT,
        Place::Animation => ANIMATION,
        Place::Shapes => &[("for", Rule::drawing_for)],
        Place::Binds | Place::Resets | Place::Options | Place::Free | Place::Data => &[],
    }
}

/// What the members of a list are called.
pub fn member(place: Place) -> &'static str {
    match place {
        Place::File => "item of a file",
        Place::Model => "statement of a model",
        Place::Experiment => "setting of an experiment",
        Place::Rows | Place::Initial => "constraint",
        Place::Binds | Place::Guess => "binding",
        Place::Resets => "reset",
        Place::Options | Place::Mechanics => "option",
        Place::Free => "freed parameter",
        Place::Data => "column of data",
        Place::Plot => "member of a plot",
        Place::Animation => "member of an animation",
        Place::Shapes => "shape of an animation",
    }
}

/// Where a word stands wrongly, and where it belongs.
pub fn belongs(word: &str, place: Place) -> Option<(&'static str, &'static str)> {
    let here = match place {
        Place::File => "at the top level of a file",
        Place::Model => "in a model",
        Place::Experiment => "in an experiment",
        _ => "in this block",
    };
    let is_in = |list: Starts| list.iter().any(|(start, _)| *start == word);
    let there = if is_in(MODEL) {
        "into a model"
    } else if is_in(EXPERIMENT) {
        "into an experiment"
    } else if is_in(FILE) {
        "to the top level of a file; a `}` may be missing before it"
    } else {
        return None;
    };
    Some((here, there))
}

/// Whether a word says in another language, or another spelling, what `meant` does, with the same words behind it.
pub fn is_another_word_for(word: &str, meant: &str) -> bool {
    const SAME: [(&str, &str); 8] = [
        ("function", "fn"),
        ("func", "fn"),
        ("def", "fn"),
        ("constant", "const"),
        ("parameter", "param"),
        ("minimise", "minimize"),
        ("optimise", "optimize"),
        ("simulation", "simulate"),
    ];
    SAME.contains(&(word, meant))
}

/// The start of a member that `word` may have been meant for.
pub fn suggestion(word: &str, place: Place) -> Option<&'static str> {
    let starts = || starts(place).iter().map(|(start, _)| *start);
    let alias = ALIASES
        .iter()
        .find(|(alias, _)| alias.eq_ignore_ascii_case(word));
    let alias = alias.map(|(_, meant)| *meant);
    alias
        .filter(|meant| starts().any(|start| start == *meant))
        .or_else(|| nearest(word, starts()))
}

/// The candidate that differs from `word` by a slip of the fingers.
pub fn nearest<'w>(word: &str, candidates: impl Iterator<Item = &'w str>) -> Option<&'w str> {
    if word.len() > 32 {
        return None;
    }
    let tolerance = (word.chars().count() / 3).max(1);
    candidates
        .map(|candidate| (strsim::osa_distance(word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= tolerance && *distance < candidate.len())
        .min()
        .map(|(_, candidate)| candidate)
}

/// Words of other languages.
const ALIASES: [(&str, &str); 28] = [
    ("import", "use"),
    ("include", "use"),
    ("function", "fn"),
    ("func", "fn"),
    ("def", "fn"),
    ("constant", "const"),
    ("class", "model"),
    ("system", "model"),
    ("simulation", "simulate"),
    ("experiment", "simulate"),
    ("minimise", "minimize"),
    ("optimise", "optimize"),
    ("parameter", "param"),
    ("variable", "state"),
    ("var", "state"),
    ("real", "state"),
    ("mode", "region"),
    ("when", "jump"),
    ("event", "jump"),
    ("reset", "jump"),
    ("time", "horizon"),
    ("t_end", "horizon"),
    ("tspan", "horizon"),
    ("stop_time", "horizon"),
    ("duration", "horizon"),
    ("tol", "tolerance"),
    ("constraints", "subject"),
    ("cost", "minimize"),
];

/// Words that begin an expectation of more than numbers, with the word that each has behind it; `warning` has a code.
pub const EXPECTATIONS: [(&str, Option<&str>); 5] = [
    ("mode", Some("is")),
    ("status", Some("is")),
    ("lowering", Some("golden")),
    ("numbers", Some("golden")),
    ("warning", None),
];

/// What a rule of the grammar is called in a message; alternatives are separated by `|`.
pub fn describe(rule: Rule) -> &'static str {
    match rule {
        Rule::name | Rule::path => "a name",
        Rule::dotted_path | Rule::relative_path => "the path of a file",
        Rule::use_names => "`.{`",
        Rule::use_alias => "`as`",
        Rule::fn_params => "`(`",
        Rule::severity => "`error`|`warning`",
        Rule::body | Rule::rows | Rule::binds | Rule::resets | Rule::options | Rule::finite_set => {
            "`{`"
        }
        Rule::sizes | Rule::interval | Rule::part_index => "`[`",
        Rule::unit | Rule::unit_factor => "a unit",
        Rule::unit_power => "a number|`(`",
        Rule::unit_op => "`*`|`/`",
        Rule::unit_sign => "`-`",
        Rule::domain => "`in`",
        Rule::sliding => "`linear`|`nonlinear`",
        Rule::binder => "an index such as `i in 1..n`",
        Rule::guard_where => "`where`",
        Rule::guard_indicator => "`indicator`",
        Rule::guard_else => "`else`",
        Rule::metric => "`metric`",
        Rule::argmin => "`argmin`",
        Rule::variational => "`variational`",
        Rule::relator => "`<=`|`>=`|`=`",
        Rule::dynamics_op => "`=`|`+=`",
        Rule::zero => "`0`",
        Rule::horizon_free => "`free`",
        Rule::every => "`every`",
        Rule::offset => "`offset`",
        Rule::at | Rule::instant => "`at`",
        Rule::always => "`always`",
        Rule::within => "`within`",
        Rule::by => "`by`",
        Rule::seed => "`seed`",
        Rule::weight => "`weight`",
        Rule::arrow => "`->`",
        Rule::length => "`cm`|`mm`|`px`",
        Rule::number => "a number",
        Rule::string => "a string",
        Rule::expect_op => "`~`|`<=`|`>=`|`<`|`>`|`=`",
        Rule::colon => "`:`",
        Rule::row_break => "`;`",
        _ => "an expression",
    }
}
