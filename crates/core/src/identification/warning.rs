//! Every warning and remark about a point, with its values. `mapper-report` turns them into sentences; nothing reads a sentence.

use crate::Channel;
use crate::enums::coded_enum;
use serde::{Deserialize, Serialize};

coded_enum! {
/// A warning or remark about a point, by its stable code. Values are in the unit of their names, readings in that of their channel.
Warning {
    /// The median of a step is outside the range of a running machine.
    "dead_channel" DeadChannel { channel: Channel, reading: f64 },
    /// The reading was constant for seconds.
    "frozen_channel" FrozenChannel { channel: Channel, reading: f64, from_s: f64, to_s: f64 },
    /// A noisy channel repeated a value within the step.
    "stuck" Stuck { channel: Channel, duration_s: f64 },
    /// The noise is far larger than declared; one standard deviation, in the channel's unit.
    "noisy_channel" NoisyChannel { channel: Channel, noise: f64, declared_noise: f64 },
    /// A wrong scale, an offset or a drift.
    "scaled_channel" ScaledChannel(Scaled),
    /// Two channels are swapped.
    "swapped_channels" SwappedChannels(Swapped),
    /// A channel lags the others, or leads them if `lag_s` is negative.
    "late_channel" LateChannel { channel: Channel, lag_s: f64, jumps: usize },
    /// Channels contradict each other.
    "contradicted_channel" ContradictedChannel { faults: Vec<SuspectedFault> },
    /// The machine differs from its nominal map by more than its declared tolerances.
    "off_the_nominal_map" OffTheNominalMap { faults: Vec<SuspectedFault> },
    /// Steps overlap, or share a number.
    "steps_contradict" StepsContradict(StepConflict),
    /// Samples were lost (NaN, gaps).
    "lost_samples" LostSamples { lost: usize, samples: usize },
    /// Spikes were excluded.
    "outliers" Outliers { count: usize },
    /// The calibration of a sensor does not support its readings.
    "calibration" Calibration { channel: Channel, sensor: String, defect: CalibrationDefect },
    /// Part of the final state of the step is older than its last seconds.
    "end_state" EndState { channel: Channel, lost_before_end_s: f64 },

    /// No jump leads to the step (dynamic method).
    "no_transient" NoTransient,
    /// The efficiency comes from the shared parameters, because no jump leads to the step, or from a convection law of this origin.
    "from_convection_law" FromConvectionLaw { convection_origin: Option<String> },
    /// The window has too few complete samples.
    "too_few_samples" TooFewSamples(TooFew),
    /// The requested window does not fit into the step.
    "window_cut" WindowCut { requested_end_s: f64, step_s: f64 },
    /// Speed, flow or pressure ratio did not stabilise in time; `used_s` is the end of the window that is used instead.
    "not_stabilised" NotStabilised { quantity: String, settled_s: f64, needed_s: f64, used_s: Option<f64> },
    /// A temperature still drifts (steady method).
    "not_settled" NotSettled { channel: Channel, drift_k_min: f64, limit_k_min: f64 },
    /// The flow, and therefore h, changed within the window.
    "flow_moved" FlowMoved { flow_change_ratio: f64, eta_error: f64, h_error_w_m2k: f64 },
    /// The step ended outside the band of its speed.
    "speed_not_reached" SpeedNotReached { requested_rpm: f64, reached_rpm: f64 },
    /// The efficiency includes heat transfer.
    "apparent" Apparent,
    /// The line of a table of steady points reaches surge here.
    "surge_end" SurgeEnd { evidence: EndEvidence },
    /// The line of a table of steady points reaches choke here.
    "choke_end" ChokeEnd { evidence: EndEvidence },
    /// No efficiency can be derived.
    "no_compression" NoCompression(NoCompression),
    /// The best fit lies on a bound of the search.
    "at_bound" AtBound(Bound),
    /// The fit did not converge.
    "fit_failed" FitFailed(FitFailure),
    /// The residual is larger than noise.
    "poor_fit" PoorFit(PoorFit),

    /// T2 changes too little to separate efficiency from heat transfer.
    "small_gradient" SmallGradient { dt2_k: f64, needed_dt2_k: f64, eta_sigma: f64 },
    /// Declared offsets make the efficiency uncertain.
    "offsets_dominate" OffsetsDominate(WideInterval),
    /// Noise makes the efficiency uncertain.
    "noise_dominates" NoiseDominates(WideInterval),
    /// The efficiencies depend on declared uncertainties; from the recording alone they have this error.
    "prior_dominated" PriorDominated { eta_error: f64 },
    /// The efficiency depends on an alpha_A with too large an uncertainty.
    "assumed_alpha" AssumedAlpha { alpha_area_ratio: f64, alpha_area_sigma_ratio: f64, eta_sigma: f64 },
    /// No sensor uncertainty is declared.
    "nothing_declared" NothingDeclared,

    /// The step is excluded from the shared parameters.
    "left_out" LeftOut(LeftOut),
    /// h of the point is far from the convection law of the others.
    "off_the_law" OffTheLaw { h_deviation_ratio: f64 },
    /// The joint model does not describe the recording as a whole.
    "model_doubted" ModelDoubted(ModelDoubt),
}
}

/// Declares the kinds of warnings with one code.
macro_rules! kinds {
    ($($(#[doc = $doc:literal])* $name:ident { $($(#[doc = $of:literal])* $kind:ident $({ $($field:ident: $type:ty),* })?,)* })*) => {
        $(
            $(#[doc = $doc])*
            #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
            #[serde(tag = "kind", rename_all = "snake_case")]
            #[allow(missing_docs, reason = "the fields' names are their quantities and units")]
            pub enum $name { $($(#[doc = $of])* $kind $({ $($field: $type),* })?,)* }
        )*
    };
}

kinds! {
    /// Defect of a calibration; values in the unit of the channel.
    CalibrationDefect {
        /// A required key is missing; if `key` is `calibration`, the whole calibration is missing.
        Missing { key: String },
        /// The calibration was due before the day of the run; days as year-month-day.
        Expired { due: String, day: String },
        /// Readings are outside the calibrated range; `reading` is the farthest one.
        Range { reading: f64, min: f64, max: f64 },
        /// The certificate's standard uncertainty is larger than the declared one.
        Uncertainty { certified: f64, declared: f64 },
    }
    /// Evidence for a scaled channel; medians.
    Scaled {
        /// N, m_c and P2/P1 give an impossible specific speed.
        SpecificSpeed { speed_rpm: f64, flow_kg_s: f64, pressure_ratio: f64, specific_speed: f64 },
        /// T2 does not follow from the pressure ratio.
        ApparentEfficiency { rise_k: f64, t1_k: f64, pressure_ratio: f64, isentropic_rise_k: f64, efficiency: f64 },
        /// T2 does not follow from the pressure ratio, at some points only.
        SomePoints,
        /// The compressor takes more power than the turbine delivers, or far less.
        ShaftPower { compressor_w: f64, turbine_w: f64, power_ratio: f64 },
    }
    /// Evidence for swapped channels; medians.
    Swapped {
        /// P2 lies below P1 at `points` of `of` points.
        P2BelowP1 { points: usize, of: usize, p1_pa: f64, p2_pa: f64 },
        /// T2 is hotter than T3 at most points.
        T2AboveT3,
        /// The housing jumps more than the gas.
        TcBeforeT2 { tc_jump_k: f64, t2_jump_k: f64 },
    }
    /// A contradiction of step marks. Numbers from 1.
    StepConflict {
        /// Two steps overlap.
        Overlap { first: usize, first_start_s: f64, first_end_s: f64, second: usize, second_start_s: f64, second_end_s: f64 },
        /// Several steps have the same number.
        SharedNumber { number: usize, steps: usize },
    }
    /// Reason for too few samples.
    TooFew {
        /// The step has no room for a window after its jump.
        ShortStep { step_s: f64 },
        /// The commands changed until shortly before the end.
        LateCommands { before_end_s: f64 },
        /// Too few samples in the window.
        Samples { complete: usize, lost: usize, needed: usize },
    }
    /// Reason for no efficiency.
    NoCompression {
        /// The table has no T2.
        NoT2,
        /// The temperature rise does not match the pressure ratio.
        NoRise { rise_k: f64, pressure_ratio: f64 },
        /// The pressure ratio is at most 1.
        NoPressureRise,
    }
    /// The quantity that reached a bound of the search.
    Bound {
        /// Efficiency.
        Eta { eta: f64 },
        /// Heat-transfer coefficient.
        H { h_w_m2k: f64 },
    }
    /// The fit that failed.
    FitFailure {
        /// The fit of this step.
        Step,
        /// The fit of all steps; this step was identified alone.
        AllSteps,
        /// The fit gave no finite number for this step.
        NotFinite,
    }
    /// Evidence for a poor fit.
    PoorFit {
        /// Impossible efficiency.
        Eta { eta: f64 },
        /// The residual of T2 relative to the declared noise.
        NoiseRatio { residual_ratio: f64 },
        /// The residual of T2 and the part that the declared noise explains.
        Noise { residual_k: f64, noise_k: f64 },
        /// The residual of T2 is systematic: it remains in means over `block_s`, while T2 changes by `dt2_k`.
        Shape { residual_k: f64, block_s: f64, dt2_k: f64 },
    }
    /// Reason for excluding a step from the shared parameters.
    LeftOut {
        /// The step fits far worse than the others.
        PoorFit,
        /// Readings failed a check.
        Readings,
        /// Region of the map disagrees with the others.
        Region { region: MapRegion, sigmas: f64, doubts: Vec<ModelDoubt> },
    }
    /// Evidence against the joint model.
    ModelEvidence {
        /// Slow part of the residual, relative to that of the declared noise.
        SlowResidual { residual_ratio: f64 },
        /// Scatter of the points about the convection law.
        Scatter { scatter_ratio: f64 },
        /// The change of Tc is not that of a housing of one, two or three masses: its residual, relative to that of the declared noise, and the spread of
        /// the heat that the steps' balances do not have.
        Housing { residual_ratio: f64, heat_w: f64 },
        /// Points with an impossible efficiency.
        Eta { points: usize, max_eta: f64 },
    }
}

/// An argument against the joint model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelDoubt {
    /// The evidence.
    #[serde(flatten)]
    pub evidence: ModelEvidence,
}

/// An end of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapRegion {
    /// Near choke.
    Choke,
    /// Near surge.
    Surge,
    /// At the lowest speeds.
    LowestSpeeds,
    /// At the highest speeds.
    HighestSpeeds,
}

/// Evidence for an end of a speed line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndEvidence {
    /// The row of the point names it.
    Named,
    /// The pressure ratio does not rise any more towards smaller flow.
    ZeroSlope,
    /// The efficiency falls below 58 %.
    Efficiency,
    /// The pressure ratio falls without more flow.
    Vertical,
    /// The outermost point: the end lies beyond it.
    NotReached,
}

/// A wide interval of the efficiency: standard errors as fractions, and the signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WideInterval {
    /// Standard error from noise.
    pub eta_noise_sigma: f64,
    /// Standard error from declared offsets and gains, and from shared parameters.
    pub eta_bias_sigma: f64,
    /// The signal.
    #[serde(flatten)]
    pub signal: EtaSignal,
}

/// Signal from which an efficiency is derived.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum EtaSignal {
    /// A change of T2 in the window, K.
    Transient {
        /// Change of T2, K.
        dt2_k: f64,
        /// Whether shared parameters contribute to the errors.
        shared: bool,
    },
    /// A settled temperature rise.
    Settled {
        /// T2 - T1, K.
        rise_k: f64,
    },
}

/// A fault that explains contradictions of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SuspectedFault {
    /// Name, e.g. `offset of T2`.
    pub fault: String,
    /// Channels with the fault; empty for a fault of the machine.
    pub channels: Vec<Channel>,
    /// Size, in `unit`.
    pub value: f64,
    /// One standard error of the size.
    pub sigma: f64,
    /// SI unit, or `1`.
    pub unit: String,
    /// Names of other faults that are at least one twentieth as probable.
    pub alternatives: Vec<String>,
    /// Whether results of the points depend on it; if not, the points keep their verdicts.
    pub touches_points: bool,
    /// Where it shows while the machine is at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_rest: Option<SeenAtRest>,
}

/// A standstill in which sensors that must read the same do not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SeenAtRest {
    /// Start of the compared part, s.
    pub start_s: f64,
    /// Its end, s.
    pub end_s: f64,
    /// Whether an isothermal zero can use this standstill.
    pub is_soak: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{from_value, json, to_value};

    #[test]
    fn values_and_code_survive_a_file() {
        let doubt = ModelDoubt { evidence: ModelEvidence::SlowResidual { residual_ratio: 2.0 } };
        let signal = EtaSignal::Settled { rise_k: 3.0 };
        let region = LeftOut::Region { region: MapRegion::Choke, sigmas: 7.0, doubts: vec![doubt.clone()] };
        let all = [
            Warning::NoTransient,
            Warning::DeadChannel { channel: Channel::P2, reading: 3.0 },
            Warning::Outliers { count: 2 },
            Warning::SwappedChannels(Swapped::T2AboveT3),
            Warning::OffsetsDominate(WideInterval { eta_noise_sigma: 0.01, eta_bias_sigma: 0.02, signal }),
            Warning::LeftOut(region),
            Warning::ModelDoubted(doubt),
        ];
        for warning in all {
            let value = to_value(&warning).unwrap();
            assert_eq!(value["code"], warning.code());
            assert!(Warning::CODES.contains(&warning.code()));
            assert_eq!(from_value::<Warning>(value).unwrap(), warning);
        }
        assert_eq!(
            to_value(Warning::SwappedChannels(Swapped::TcBeforeT2 { tc_jump_k: 9.0, t2_jump_k: 1.0 }))
                .unwrap(),
            json!({"code": "swapped_channels", "kind": "tc_before_t2", "tc_jump_k": 9.0, "t2_jump_k": 1.0})
        );
    }

    #[test]
    fn files_without_values_keep_code_and_message() {
        for code in ["small_gradient", "of_a_later_version"] {
            let old: Warning = from_value(json!({"code": code, "message": "T2 moves"})).unwrap();
            assert_eq!(old, Warning::Other { code: code.to_owned(), message: "T2 moves".to_owned() });
        }
        assert!(from_value::<Warning>(json!({"message": "no code"})).is_err());
    }
}
