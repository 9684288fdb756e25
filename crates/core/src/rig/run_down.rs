//! Setpoints of a rig during the safe shutdown.

use crate::{OperatingPoint, RigMode, SafeTrajectory, SetpointRange, SetpointRanges, Setpoints};

/// Setpoint at which a heater does not heat, K.
const HEATER_OFF_K: f64 = 293.15;

impl SafeTrajectory {
    /// Setpoints at the time `after_s` of a shutdown that began at the setpoints `from`: heater off, valve open, P3 falling at its slew rate. `None` means that the air
    /// must be cut off: without a slew rate at once, otherwise at the end of the shutdown or once P3 has reached `p3_min_pa`.
    ///
    /// Heater and valve setpoints are limited to the ranges of the rig. A rig that does not accept 293 K gets its lowest setpoint, because a
    /// rejected command would cut off the air at full pressure.
    pub fn setpoints(
        &self,
        from: &Setpoints,
        after_s: f64,
        p3_min_pa: f64,
        accepts: Option<&SetpointRanges>,
    ) -> Option<Setpoints> {
        let p3_pa = from.p3_pa - self.p3_slew_pa_s? * after_s;
        let is_running = from.mode == RigMode::Running && after_s <= self.within_s && p3_pa > p3_min_pa;
        let clamp_to = |value: f64, range: Option<SetpointRange>| match range {
            Some(SetpointRange { low, high }) => value.min(high).max(low),
            None => value,
        };
        let opening =
            from.valve_opening_ratio.max(self.valve_opening_ratio).min(OperatingPoint::OPENING_MAX_RATIO);
        is_running.then_some(Setpoints {
            p3_pa,
            t3_k: clamp_to(HEATER_OFF_K, accepts.map(|accepts| accepts.t3_k)),
            valve_opening_ratio: clamp_to(opening, accepts.map(|accepts| accepts.valve_opening_ratio)),
            ..*from
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rig_is_reported_nothing_that_it_refuses() {
        let safe = SafeTrajectory { p3_slew_pa_s: Some(50e3), valve_opening_ratio: 1.0, within_s: 20.0 };
        let from = Setpoints {
            mode: RigMode::Running,
            p3_pa: 300e3,
            t3_k: 873.15,
            valve_opening_ratio: 0.6,
            oil_temperature_k: 323.15,
        };
        let range = |low, high| SetpointRange { low, high };
        let accepts = SetpointRanges {
            p3_pa: range(105e3, 400e3),
            t3_k: range(400.0, 900.0),
            valve_opening_ratio: range(0.1, 0.9),
            oil_temperature_k: range(280.0, 400.0),
        };
        let free = safe.setpoints(&from, 1.0, 105e3, None).unwrap();
        assert_eq!((free.p3_pa, free.t3_k, free.valve_opening_ratio), (250e3, 293.15, 1.0));
        let bounded = safe.setpoints(&from, 1.0, 105e3, Some(&accepts)).unwrap();
        assert_eq!((bounded.t3_k, bounded.valve_opening_ratio), (400.0, 0.9));
        assert!(accepts.check(&bounded).is_ok());
        // (300 - 105) kPa at 50 kPa/s are 3.9 s.
        assert!(safe.setpoints(&from, 3.8, 105e3, Some(&accepts)).is_some());
        assert_eq!(safe.setpoints(&from, 4.0, 105e3, Some(&accepts)), None);
        assert_eq!(SafeTrajectory { p3_slew_pa_s: None, ..safe }.setpoints(&from, 0.1, 0.0, None), None);
    }
}
