//! Exceptions of what is wrong with a model.

use std::panic::{AssertUnwindSafe, catch_unwind};

use nsdc::Messages;
use pyo3::prelude::*;

/// `nsdc.ModelError`, with all that there is to say.
pub fn model_error(messages: &Messages) -> PyErr {
    Python::attach(|py| {
        of_package(py, |errors| {
            errors
                .getattr("ModelError")?
                .call_method1("_of", told(messages))
        })
    })
}

/// An exception that is made from the classes of the package.
fn of_package<'py>(
    py: Python<'py>,
    make: impl FnOnce(&Bound<'py, PyModule>) -> PyResult<Bound<'py, PyAny>>,
) -> PyErr {
    let made = py.import("nsdc._errors").and_then(|errors| make(&errors));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// Does something without the interpreter; what panics in it is raised as `nsdc.InternalError`.
///
/// # Errors
///
/// That.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let found = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    found.map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        let text = text.unwrap_or_default();
        of_package(py, |errors| errors.call_method1("InternalError", (text,)))
    })
}

/// The same for what cannot be done to every model: what is wrong with one is raised as `nsdc.ModelError`.
///
/// # Errors
///
/// That.
pub fn compiling<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Messages> + Send,
) -> PyResult<T> {
    detached(py, work)?.map_err(|messages| model_error(&messages))
}

/// Messages as a list of the lines of `nsdc check --json`, and as a terminal shows them.
pub fn told(messages: &Messages) -> (String, String) {
    // Names and numbers only: nothing that serialization can refuse.
    let json = serde_json::to_string(&messages.list()).unwrap_or_default();
    (json, messages.render(false, 100))
}
