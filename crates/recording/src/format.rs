//! Names and version of the recording format.

/// Version of the recording format.
///
/// Increased when a reader of the previous version would misread a file: a topic, field or unit changes its meaning. New
/// topics, fields and metadata keys do not increase it, since readers skip unknown ones.
///
/// Version 2 numbers the steps on `/step` from 1, as `step`. Version 1 has `index` there, from 0, and can still be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FormatVersion(pub u32);

impl FormatVersion {
    /// Version written by this program.
    pub const CURRENT: FormatVersion = FormatVersion(2);
}

impl std::fmt::Display for FormatVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

pub(crate) const STEP_TOPIC: &str = "/step";
pub(crate) const EVENT_TOPIC: &str = "/event";
/// Topic of the single sensors of channels that have several.
pub(crate) const ELEMENTS_TOPIC: &str = "/rig/elements";
/// Topic of readings with an unusual quality or source time.
pub(crate) const PROVENANCE_TOPIC: &str = "/rig/provenance";
pub(crate) const TRUTH_TOPIC: &str = "/truth/model";
/// Everything below this topic is for scoring only.
pub(crate) const TRUTH_PREFIX: &str = "/truth";
/// Name of the metadata record that marks a recording of this program.
pub(crate) const METADATA_NAME: &str = "mapper.recording";
/// Key of the format version in the metadata record.
pub(crate) const FORMAT_KEY: &str = "format";
/// Key of the epoch time of run time 0, in nanoseconds.
pub(crate) const START_KEY: &str = "start_time_ns";
pub(crate) const PLAN_NAME: &str = "plan.json";
pub(crate) const CAMPAIGN_NAME: &str = "campaign.yaml";
