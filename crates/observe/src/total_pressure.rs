//! Converts the readings of static taps to total pressures, so that a recording can be compared with a model.

use mapper_core::{Channel, Recording};
use mapper_physics::gas::pressure_tap::static_to_total_pa;

/// A static tap: the pressure's channel, and the inner diameter of the pipe, m, > 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticTap {
    /// P1, P2 or P3; the outlet of a turbine is defined by its static pressure.
    pub pressure: Channel,
    /// Inner diameter of the pipe at the tap, m.
    pub pipe_diameter_m: f64,
}

impl StaticTap {
    /// Flow and total temperature at the tap; `None` for a channel whose static pressure is the quantity itself.
    fn stream(self) -> Option<(Channel, Channel)> {
        match self.pressure {
            Channel::P1 => Some((Channel::CompressorFlow, Channel::T1)),
            Channel::P2 => Some((Channel::CompressorFlow, Channel::T2)),
            Channel::P3 => Some((Channel::TurbineFlow, Channel::T3)),
            _ => None,
        }
    }
}

/// The recording with total pressures at `taps`. A reading without flow or temperature stays as it is.
pub fn with_total_pressures(mut recording: Recording, taps: &[StaticTap]) -> Recording {
    for tap in taps {
        let Some((flow, temperature)) = tap.stream() else { continue };
        let Recording { series, .. } = &recording;
        let streams = series.get(&tap.pressure).zip(series.get(&flow)).zip(series.get(&temperature));
        let Some(((pressure, flow), temperature)) = streams else { continue };
        let total_pa = |(t_s, static_pa): (&f64, &f64)| {
            let flow_kg_s = flow.interpolate(*t_s);
            let total = flow_kg_s.zip(temperature.interpolate(*t_s)).map(|(flow_kg_s, temperature_k)| {
                static_to_total_pa(*static_pa, flow_kg_s, temperature_k, tap.pipe_diameter_m)
            });
            total.filter(|total_pa| total_pa.is_finite()).unwrap_or(*static_pa)
        };
        let values: Vec<f64> = pressure.t_s.iter().zip(&pressure.values).map(total_pa).collect();
        if let Some(pressure) = recording.series.get_mut(&tap.pressure) {
            pressure.values = values;
        }
    }
    recording
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::Series;
    use mapper_physics::gas::pressure_tap::total_to_static_pa;

    /// 0.08 kg/s through 40 mm at 298.15 K and 100 kPa: 1.7 kPa of dynamic pressure. A total of 100 kPa is found again; without flow the reading
    /// stays.
    #[test]
    fn a_wall_pressure_becomes_the_total_pressure_of_its_flow() {
        let static_pa = total_to_static_pa(100e3, 0.08, 298.15, 0.04).unwrap();
        assert!((1500.0..2000.0).contains(&(100e3 - static_pa)), "{static_pa}");
        let series = |values: [f64; 2]| Series { t_s: vec![0.0, 1.0], values: values.to_vec() };
        let recording = Recording {
            series: [
                (Channel::P1, series([100e3, static_pa])),
                (Channel::CompressorFlow, series([0.0, 0.08])),
                (Channel::T1, series([298.15; 2])),
            ]
            .into(),
            ..Recording::default()
        };
        let tap = StaticTap { pressure: Channel::P1, pipe_diameter_m: 0.04 };
        let total = with_total_pressures(recording, &[tap]);
        let values = &total.series[&Channel::P1].values;
        assert!(values.iter().all(|total_pa| (total_pa - 100e3).abs() < 1e-3), "{values:?}");
    }
}
