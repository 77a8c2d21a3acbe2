//! Exceptions of what is wrong with a model.

use nsdc::Messages;
use pyo3::prelude::*;

/// `nsdc.ModelError`, with all that there is to say.
pub fn model_error(messages: &Messages) -> PyErr {
    Python::attach(|py| {
        let made = py.import("nsdc._errors").and_then(|module| {
            let error = module.getattr("ModelError")?;
            error.call_method1("_of", (json(messages), messages.render(false, 100)))
        });
        made.map_or_else(|error| error, PyErr::from_value)
    })
}

/// A line of `nsdc check --json` for each.
pub fn json(messages: &Messages) -> String {
    // Names and numbers only: nothing that serialization can refuse.
    serde_json::to_string(&messages.list()).unwrap_or_default()
}
