//! Figures of the paper by Burke et al., recomputed with the program's own model and methods.

pub(crate) mod figure_10;
pub(crate) mod figure_11;
pub(crate) mod figure_12;
pub(crate) mod figure_2;
pub(crate) mod figure_5;
pub(crate) mod figure_6;
pub(crate) mod figure_7;
pub(crate) mod figure_8;
pub(crate) mod figure_9;
