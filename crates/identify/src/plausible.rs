//! Readings that no gas stand can give are treated as lost.

use mapper_core::{Channel, Dimension};

/// Whether a reading is finite and within what any rig could show, wide apart: 100..3000 K, 100 Pa..1 GPa, -100..100
/// kg/s, 0..10 million rpm.
pub(crate) fn plausible(channel: Channel, value: f64) -> bool {
    let range = match channel.info().dimension {
        Dimension::Temperature => 100.0..=3000.0,
        Dimension::Pressure => 100.0..=1e9,
        Dimension::MassFlow => -100.0..=100.0,
        Dimension::RotationalSpeed => 0.0..=1e7,
        Dimension::Ratio => return value.is_finite(),
    };
    range.contains(&value)
}
