//! Compressor maps for the model, in closed form or as speed lines, with similarity laws and limits of flow.

pub mod closed_form_map;
pub mod tabulated_map;
