//! The parameters of a joint fit: those that all steps share, and those of each step.

use crate::joint::step_model::surface::TERM_COUNT;
use mapper_core::Channel;

/// Place of a parameter in [`SharedVector`] or [`LocalVector`]: a name, not a choice.
pub(crate) type Place = usize;

/// ln of the Nusselt coefficient at the reference Reynolds number.
pub(crate) const LN_COEFFICIENT: Place = 0;
/// Exponent of the Reynolds number.
pub(crate) const EXPONENT: Place = 1;
/// alpha_A.
pub(crate) const ALPHA: Place = 2;
/// Square of the probe's diameter, mm2: the lag grows with it from 0.
pub(crate) const PROBE_MM2: Place = 3;
/// ln of the heating/cooling ratio of h.
pub(crate) const LN_HEATING_COOLING_RATIO: Place = 4;
/// First offset, in the order of [`OFFSET_CHANNELS`]; K or Pa.
pub(crate) const OFFSETS: Place = 5;
/// Channels with an offset.
pub(crate) const OFFSET_CHANNELS: [Channel; 5] =
    [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2];
/// The flow meter's gain error, ratio.
pub(crate) const FLOW_GAIN: Place = OFFSETS + OFFSET_CHANNELS.len();
/// The first gain error, ratio, in the order of [`GAIN_CHANNELS`].
pub(crate) const GAINS: Place = FLOW_GAIN + 1;
/// Channels with a gain error in addition to the flow meter. That of T1 is an offset: its reading hardly changes.
pub(crate) const GAIN_CHANNELS: [Channel; 4] = [Channel::T2, Channel::Tc, Channel::P1, Channel::P2];
/// Index of the error that P1 and P2 share, Pa: the barometer of gauge transducers.
pub(crate) const BAROMETER: Place = GAINS + GAIN_CHANNELS.len();
/// Index of the humidity's error, kg/kg.
pub(crate) const HUMIDITY: Place = BAROMETER + 1;
/// Degree to which h before the wheel follows the inlet's own law: 0 is h after the wheel, 1 is that law, with a power law
/// between. Never fitted: a recording carries almost no information about it next to alpha_A.
pub(crate) const INLET: Place = HUMIDITY + 1;
/// ln of the internal area over its value. A recording determines h times the area, so an error of the area is one of h alone.
pub(crate) const LN_AREA: Place = INLET + 1;
/// First coefficient of the efficiency surface.
pub(crate) const SURFACE: Place = LN_AREA + 1;
/// First bend of the efficiencies that an offset causes, in the order of [`OFFSET_CHANNELS`] and in units of that offset. The fit
/// takes the readings as exact, so an offset bends the fitted efficiencies. Without these terms the surface would resist that bend and bias
/// alpha_A, the probe and the heating/cooling ratio.
pub(crate) const BENDS: Place = SURFACE + TERM_COUNT;
/// Number of shared parameters.
pub(crate) const SHARED: usize = BENDS + OFFSET_CHANNELS.len();

/// Efficiency at the step's end, fraction.
pub(crate) const ETA: Place = 0;
/// ln of the point's h over the law.
pub(crate) const LN_DEVIATION: Place = 1;
/// Reading of the probe at the first row, K.
pub(crate) const FIRST_READING: Place = 2;
/// Scale of the surface's slope.
pub(crate) const SLOPE: Place = 3;
/// Number of parameters of a step.
pub(crate) const LOCAL: Place = SLOPE + 1;

/// Values of the shared parameters.
pub(crate) type SharedVector = [f64; SHARED];
/// Values of a step's parameters.
pub(crate) type LocalVector = [f64; LOCAL];

/// A normal distribution; infinite `sigma` means no information.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prior {
    pub(crate) mean: f64,
    pub(crate) sigma: f64,
}

impl Prior {
    /// One over the variance.
    pub(crate) fn weight(&self) -> f64 {
        1.0 / (self.sigma * self.sigma)
    }
}

/// Each parameter with a prior about its declared value: standard deviation of the prior under which it is fitted (wide), standard
/// deviation of its slab in the mixture, and the change that small model errors can cause. Compressors have 0 to 0.3 of their area before
/// the wheel. Probes of 0.5 to 3 mm are sold, and half a millimetre is a sheathed thermocouple. Heated and cooled boundary layers differ
/// by up to a third (Gnielinski's (Pr/Pr_w)^0.11 and (T/T_w)^0.45 between 300 and 600 K). A change of alpha_A by its model error moves an
/// efficiency by a quarter of a point, as do the offsets. Calibrated: `benches/identification.py`; with 0.025 the error at an undeclared
/// alpha_A of 0.05 is 2.1 points instead of 0.4.
pub(crate) const REFINEMENTS: [(Place, f64, f64, f64); 3] =
    [(ALPHA, 0.3, 0.1, 0.005), (PROBE_MM2, 10.0, 2.0, 0.1), (LN_HEATING_COOLING_RATIO, 0.5, 0.2, 0.015)];

/// Display symbol of a shared parameter.
pub(crate) fn symbol(index: usize) -> String {
    match index {
        LN_COEFFICIENT => "Nusselt coefficient".to_owned(),
        EXPONENT => "Nusselt exponent".to_owned(),
        ALPHA => "alpha_A".to_owned(),
        PROBE_MM2 => "probe diameter".to_owned(),
        LN_HEATING_COOLING_RATIO => "heating/cooling ratio".to_owned(),
        FLOW_GAIN => "gain of m_c".to_owned(),
        BAROMETER => "barometer".to_owned(),
        HUMIDITY => "humidity".to_owned(),
        INLET => "h before the wheel".to_owned(),
        LN_AREA => "internal area".to_owned(),
        GAINS..BAROMETER => format!("gain of {}", GAIN_CHANNELS[index - GAINS]),
        _ => match OFFSET_CHANNELS.get(index.wrapping_sub(OFFSETS)) {
            Some(channel) => format!("offset of {channel}"),
            None if index >= BENDS => format!("bend {}", index - BENDS),
            None => format!("efficiency surface {}", index.saturating_sub(SURFACE)),
        },
    }
}
