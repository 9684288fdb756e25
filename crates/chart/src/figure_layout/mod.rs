//! Layout of a figure before it is drawn: panels, axes, ticks, legends, and positions of labels.

pub(crate) mod clip;
pub(crate) mod figure;
pub(crate) mod frame;
pub(crate) mod point_labels;
