//! What is known of a machine before its first campaign.

use mapper_core::NamedReference;
use std::path::PathBuf;

/// Source of the recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FirstRig {
    /// The simulated stand.
    VirtualLab,
    /// A stand behind a PLC.
    GasStand,
    /// A log of another program.
    Log,
}

/// What is known of a machine.
#[derive(Debug, Clone)]
pub struct FirstCampaignRequest {
    /// Name of the campaign, and of its files.
    pub name: String,
    /// Directory of the files.
    pub directory: PathBuf,
    /// Source of the recordings.
    pub rig: FirstRig,
    /// Diameter of the compressor's wheel at its exit, m.
    pub wheel_diameter_m: f64,
    /// Diameter of the compressor's inlet pipe, m; scaled from the wheel if `None`.
    pub inlet_diameter_m: Option<f64>,
    /// Diameter of the compressor's outlet pipe, m; scaled from the wheel if `None`.
    pub outlet_diameter_m: Option<f64>,
    /// Whether P1 and P2 are measured at the wall.
    pub has_static_taps: bool,
    /// Diameter of the T2 probe, m; an ideal probe if `None`.
    pub probe_diameter_m: Option<f64>,
    /// The machine's own map; that of a similar compressor if `None`.
    pub map: Option<PathBuf>,
    /// Reference state of the map and of the results.
    pub reference: &'static NamedReference,
    /// Lowest and highest corrected speed, rpm; those of the map if `None`.
    pub speeds_rpm: Option<(f64, f64)>,
}
