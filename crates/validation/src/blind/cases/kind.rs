//! Kinds of cases.

use mapper_core::named_enum;

named_enum! {
    /// How many causes a recording has, and whether the diagnosis could know them.
    pub enum CaseKind {
        /// Nothing beyond the declared tolerances.
        None = "none",
        /// One effect of the catalogue.
        Single = "single",
        /// Two effects of the catalogue.
        Pair = "pair",
        /// A cause that is not a candidate.
        Outside = "outside",
        /// Three effects of the catalogue; drawn only on request.
        Triple = "triple",
    }
}

impl CaseKind {
    /// Default kinds of a draw.
    pub const USUAL: [CaseKind; 4] = [CaseKind::None, CaseKind::Single, CaseKind::Pair, CaseKind::Outside];
}
