//! Drawing of a laid-out figure as SVG or PNG, identical on every computer.

pub(crate) mod draw;
pub(crate) mod png;
pub(crate) mod svg;
