//! Kinds of cases.

use serde::{Deserialize, Serialize};

/// How many causes a recording has, and whether the diagnosis could know them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CaseKind {
    /// Nothing beyond the declared tolerances.
    None,
    /// One effect of the catalogue.
    Single,
    /// Two effects of the catalogue.
    Pair,
    /// A cause that is not a candidate.
    Outside,
    /// Three effects of the catalogue; drawn only on request.
    Triple,
}

impl CaseKind {
    /// Default kinds of a draw.
    pub const USUAL: [CaseKind; 4] = [CaseKind::None, CaseKind::Single, CaseKind::Pair, CaseKind::Outside];

    /// Its name in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            CaseKind::None => "none",
            CaseKind::Single => "single",
            CaseKind::Pair => "pair",
            CaseKind::Outside => "outside",
            CaseKind::Triple => "triple",
        }
    }
}

/// A name that no kind has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is not a kind of blind case; the kinds are none, single, pair, outside and triple")]
pub struct UnknownKind {
    /// The given name.
    pub name: String,
}

impl std::str::FromStr for CaseKind {
    type Err = UnknownKind;

    fn from_str(name: &str) -> Result<Self, UnknownKind> {
        let mut known = CaseKind::USUAL.into_iter().chain([CaseKind::Triple]);
        known.find(|kind| kind.name() == name).ok_or_else(|| UnknownKind { name: name.to_owned() })
    }
}
