//! The states of the model.

/// Maximum number of hidden states that all [hooks](crate::machine::hooks::Hooks) of a model may add together.
pub const MAX_EXTRA: usize = 2;

/// Maximum number of states of a model.
pub(crate) const MAX_STATES: usize = 6 + MAX_EXTRA;

/// The states: five are always integrated, the inner wall and the extra ones only if a model has them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Shaft speed, rad/s, > 0.
    pub shaft_speed_rad_s: f64,
    /// Compressor outlet total pressure (station 2), Pa.
    pub p2_pa: f64,
    /// Compressor housing temperature, K; of its outer part if the inner wall has its own.
    pub tc_k: f64,
    /// Turbine housing temperature, K.
    pub tt_k: f64,
    /// Temperature of the T2 probe's tip, K; unused with an ideal probe.
    pub t2_tip_k: f64,
    /// Inner wall of the compressor housing, K; unused if the housing is one node.
    pub inner_k: f64,
    /// Temperatures that hooks add, K; unused without them.
    pub extra_k: [f64; MAX_EXTRA],
}

impl State {
    /// A state in which the probe has the temperature of the gas, `gas_k`, and the inner wall that of the housing, `tc_k`.
    pub fn new(shaft_speed_rad_s: f64, p2_pa: f64, tc_k: f64, tt_k: f64, gas_k: f64) -> Self {
        State {
            shaft_speed_rad_s,
            p2_pa,
            tc_k,
            tt_k,
            t2_tip_k: gas_k,
            inner_k: tc_k,
            extra_k: [gas_k; MAX_EXTRA],
        }
    }

    /// Shaft speed, rpm.
    pub fn shaft_speed_rpm(&self) -> f64 {
        self.shaft_speed_rad_s * 30.0 / std::f64::consts::PI
    }

    /// The first `N` components, in the order of the fields.
    #[inline]
    pub(crate) fn to_array<const N: usize>(self) -> [f64; N] {
        let all = [
            self.shaft_speed_rad_s,
            self.p2_pa,
            self.tc_k,
            self.tt_k,
            self.t2_tip_k,
            self.inner_k,
            self.extra_k[0],
            self.extra_k[1],
        ];
        std::array::from_fn(|i| all[i])
    }

    /// Creates a state from its first `N` >= 5 components; the others are in equilibrium with the housing.
    #[inline]
    pub(crate) fn from_array<const N: usize>(y: &[f64; N]) -> Self {
        let at = |i: usize| if i < N { y[i] } else { y[2] };
        State {
            shaft_speed_rad_s: y[0],
            p2_pa: y[1],
            tc_k: y[2],
            tt_k: y[3],
            t2_tip_k: y[4],
            inner_k: at(5),
            extra_k: [at(6), at(7)],
        }
    }
}

/// Converts a shaft speed from rpm to rad/s.
pub fn rad_s_of_rpm(speed_rpm: f64) -> f64 {
    speed_rpm * std::f64::consts::PI / 30.0
}
