//! What a run of a smoothed system says about itself.

use crate::report::{Method, Warning};
use crate::source::Span;
use crate::system::System;
use crate::system::experiment::{MethodKind, SmoothingOptions};

/// The method with its options.
pub(crate) fn method(options: &SmoothingOptions) -> Method {
    Method::of(MethodKind::Smoothing)
        .number("epsilon", options.epsilon)
        .word("law", options.law.word())
}

/// That the estimate of the error is about another system than the model.
pub(crate) fn warning(system: &System, options: &SmoothingOptions, span: Span) -> Option<Warning> {
    let epsilon = options.epsilon;
    system.is_smoothed().then(|| Warning {
        code: "W0707".into(),
        message: format!(
            "switches are steep functions over a width of epsilon = {epsilon}: the result differs from \
             the model's by O(epsilon), and the estimate of the error does not tell by how much"
        ),
        span: Some(span),
    })
}
