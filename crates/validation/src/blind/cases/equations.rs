//! The simulator that makes the recordings.

use mapper_backends::{other_lab, virtual_lab};
use serde::{Deserialize, Serialize};

/// The simulator that a case runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Laboratory {
    /// The model that the diagnosis assumes.
    #[default]
    VirtualLab,
    /// Other equations: no model of the catalogue has the right structure, whatever its parameters.
    OtherLab,
}

impl Laboratory {
    /// Name of its backend.
    pub fn name(self) -> &'static str {
        match self {
            Laboratory::VirtualLab => virtual_lab::NAME,
            Laboratory::OtherLab => other_lab::NAME,
        }
    }
}

/// A name that no laboratory has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is not a laboratory for blind cases; the laboratories are virtual_lab and other_lab")]
pub struct UnknownLaboratory {
    /// The given name.
    pub name: String,
}

impl std::str::FromStr for Laboratory {
    type Err = UnknownLaboratory;

    fn from_str(name: &str) -> Result<Self, UnknownLaboratory> {
        [Laboratory::VirtualLab, Laboratory::OtherLab]
            .into_iter()
            .find(|laboratory| laboratory.name() == name)
            .ok_or_else(|| UnknownLaboratory { name: name.to_owned() })
    }
}
