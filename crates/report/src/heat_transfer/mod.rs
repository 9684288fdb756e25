//! Heat-transfer results as text, pictures and files: thermal model, h over flow, and the map corrected for heat transfer.

pub(crate) mod result_pictures;
pub(crate) mod thermal_model;
