//! Scores of the diagnosis in the blind test: hit rates with exact intervals, and reliability of probabilities.

pub mod reliability;
pub mod score;
