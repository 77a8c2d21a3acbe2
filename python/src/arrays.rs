//! Arrays of numpy over memory of a result.
#![expect(unsafe_code, reason = "numpy is told who keeps the memory")]

use numpy::PyArrayDyn;
use numpy::ndarray::{ArrayView, IxDyn};
use pyo3::PyClass;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::True;

/// A read-only array of this shape over numbers of `owner`.
///
/// # Errors
///
/// Where the numbers do not fill the shape.
pub fn view<'py, T: PyClass<Frozen = True> + Sync>(
    owner: &Bound<'py, T>,
    shape: &[usize],
    numbers: impl for<'o> FnOnce(&'o T) -> &'o [f64],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let numbers = numbers(owner.get());
    let view = ArrayView::from_shape(IxDyn(shape), numbers);
    let view = view.map_err(|error| PyValueError::new_err(error.to_string()))?;
    // SAFETY: `owner` is frozen, so that its numbers neither move nor change, and the array keeps it alive.
    let array = unsafe { PyArrayDyn::borrow_from_array(&view, owner.clone().into_any()) };
    array.call_method1("setflags", (false,))?;
    Ok(array)
}
