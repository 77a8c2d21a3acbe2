#![doc = include_str!("../README.md")]
#![allow(
    missing_docs,
    reason = "pest derives one undocumented variant per rule"
)]

/// The language reference, in Markdown.
pub const REFERENCE: &str = include_str!("../README.md");

/// The parser pest derives from `nsd.pest`.
#[derive(pest_derive::Parser)]
#[grammar = "../nsd.pest"]
pub struct NsdParser;

/// How a keyword or a punctuation mark is written; nothing for other rules.
///
/// The pairs of these rules only mark a place: they carry no content.
pub fn spelling(rule: Rule) -> Option<&'static str> {
    mark(rule).or_else(|| word(rule))
}

fn mark(rule: Rule) -> Option<&'static str> {
    Some(match rule {
        Rule::semicolon => ";",
        Rule::comma => ",",
        Rule::open_brace => "{",
        Rule::close_brace => "}",
        Rule::open_paren => "(",
        Rule::close_paren => ")",
        Rule::open_bracket => "[",
        Rule::close_bracket => "]",
        Rule::dots => "..",
        Rule::equals => "=",
        Rule::arrow => "->",
        Rule::becomes => ":=",
        Rule::at_most => "<=",
        Rule::at_least => ">=",
        Rule::prime => "'",
        _ => return None,
    })
}

fn word(rule: Rule) -> Option<&'static str> {
    Some(match rule {
        Rule::kw_always => "always",
        Rule::kw_animate => "animate",
        Rule::kw_argmin => "argmin",
        Rule::kw_as => "as",
        Rule::kw_at => "at",
        Rule::kw_by => "by",
        Rule::kw_const => "const",
        Rule::kw_contact => "contact",
        Rule::kw_controller => "controller",
        Rule::kw_data => "data",
        Rule::kw_else => "else",
        Rule::kw_every => "every",
        Rule::kw_expect => "expect",
        Rule::kw_final => "final",
        Rule::kw_fn => "fn",
        Rule::kw_for => "for",
        Rule::kw_free => "free",
        Rule::kw_from => "from",
        Rule::kw_golden => "golden",
        Rule::kw_guess => "guess",
        Rule::kw_hidden => "hidden",
        Rule::kw_horizon => "horizon",
        Rule::kw_if => "if",
        Rule::kw_in => "in",
        Rule::kw_indicator => "indicator",
        Rule::kw_initial => "initial",
        Rule::kw_is => "is",
        Rule::kw_jump => "jump",
        Rule::kw_lower => "lower",
        Rule::kw_lowering => "lowering",
        Rule::kw_mechanics => "mechanics",
        Rule::kw_method => "method",
        Rule::kw_metric => "metric",
        Rule::kw_mode => "mode",
        Rule::kw_model => "model",
        Rule::kw_numbers => "numbers",
        Rule::kw_of => "of",
        Rule::kw_offset => "offset",
        Rule::kw_on => "on",
        Rule::kw_onto => "onto",
        Rule::kw_one_sided => "one_sided",
        Rule::kw_output => "output",
        Rule::kw_part => "part",
        Rule::kw_perp => "perp",
        Rule::kw_perturb => "perturb",
        Rule::kw_phase => "phase",
        Rule::kw_plot => "plot",
        Rule::kw_project => "project",
        Rule::kw_region => "region",
        Rule::kw_seed => "seed",
        Rule::kw_sensitivity => "sensitivity",
        Rule::kw_sliding => "sliding",
        Rule::kw_solves => "solves",
        Rule::kw_chattering => "chattering",
        Rule::kw_intervals => "intervals",
        Rule::kw_slide => "slide",
        Rule::kw_soft => "soft",
        Rule::kw_starts => "starts",
        Rule::kw_status => "status",
        Rule::kw_stop => "stop",
        Rule::kw_subject => "subject",
        Rule::kw_switch => "switch",
        Rule::kw_then => "then",
        Rule::kw_title => "title",
        Rule::kw_to => "to",
        Rule::kw_use => "use",
        Rule::kw_variational => "variational",
        Rule::kw_warning => "warning",
        Rule::kw_weight => "weight",
        Rule::kw_when => "when",
        Rule::kw_where => "where",
        Rule::kw_width => "width",
        Rule::kw_with => "with",
        Rule::kw_within => "within",
        _ => return None,
    })
}
