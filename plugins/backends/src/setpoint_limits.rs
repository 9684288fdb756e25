//! Plausible setpoints of a turbocharger gas stand; others are errors of the client.

use mapper_core::{SetpointRange, SetpointRanges};

/// Setpoints accepted by the backends of this crate.
pub(crate) const ACCEPTED: SetpointRanges = SetpointRanges {
    p3_pa: SetpointRange { low: 50e3, high: 2e6 },
    t3_k: SetpointRange { low: 250.0, high: 1400.0 },
    valve_opening_ratio: SetpointRange { low: 0.05, high: 2.5 },
    oil_temperature_k: SetpointRange { low: 250.0, high: 450.0 },
};
