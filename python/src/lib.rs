//! The module `nsdc._core`: projects, runs and sweeps of [`nsdc`] as objects of Python.
//!
//! Numbers cross as arrays that share memory with a run, everything else as JSON in the fields of the language reference; the
//! package around it, in Python, gives both their shape. No function holds the interpreter while it works.

mod arrays;
mod command;
mod controller;
mod errors;
mod interrupt;
mod project;
mod recorded;
mod run;
mod session;
mod sweep;

use pyo3::prelude::*;

/// What the package imports.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<project::Project>()?;
    module.add_class::<run::Run>()?;
    module.add_class::<controller::Controller>()?;
    module.add_class::<sweep::Rows>()?;
    module.add_function(wrap_pyfunction!(command::main, module)?)?;
    module.add_function(wrap_pyfunction!(command::explain, module)?)?;
    module.add_function(wrap_pyfunction!(command::panic, module)?)?;
    Ok(())
}
