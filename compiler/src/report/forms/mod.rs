//! A trajectory as text, CSV and JSON.

pub mod csv;
pub mod json;
pub mod text;
