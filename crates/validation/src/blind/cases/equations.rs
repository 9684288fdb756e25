//! The simulator that makes the recordings.

use mapper_core::named_enum;

named_enum! {
    /// The simulator that a case runs on.
    #[derive(Default)]
    pub enum Laboratory {
        /// The model that the diagnosis assumes.
        #[default]
        VirtualLab = "virtual_lab",
        /// Other equations: no model of the catalogue has the right structure, whatever its parameters.
        OtherLab = "other_lab",
        /// Other equations again, those of [`mapper_backends::other_lab::OtherStructure::two_masses`].
        TwoMasses = "two_masses",
    }
}
