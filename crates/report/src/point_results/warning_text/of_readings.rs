//! Warnings about the readings themselves.

use crate::formatting::number::four_figures;
use crate::point_results::warning_text::sentence::{Sentence, number, sentence, signed};
use mapper_core::{
    CalibrationDefect, Channel, Dimension, Implausible, Scaled, StepConflict, SuspectedFault, Swapped,
    Warning, with_unit,
};

/// The sentence; `None` for other warnings.
pub(crate) fn sentence_of(warning: &Warning) -> Option<Sentence> {
    Some(match warning {
        Warning::DeadChannel { channel, reading } => {
            Implausible { channel: *channel, value: *reading }.to_string().into()
        }
        Warning::FrozenChannel { channel, reading, from_s, to_s } => sentence!(
            "{} shows {} and nothing else from {} s to {} s: it is frozen or saturated; the steps in which it does not change cannot be \
                 used, so repair the channel and repeat them",
            *channel,
            with_unit(format!("{reading:.6}"), channel.unit()),
            number(*from_s, 0),
            number(*to_s, 0)
        ),
        Warning::Stuck { channel, duration_s } => sentence!(
            "{} shows the same value for {} s though noise is declared: these samples are omitted",
            *channel,
            number(*duration_s, 0)
        ),
        Warning::NoisyChannel { channel, noise, declared_noise } => sentence!(
            "{} scatters by {} from sample to sample (one standard deviation), but {} is declared: repair the channel, or declare its noise",
            *channel,
            with_unit(four_figures(*noise), channel.unit()),
            with_unit(four_figures(*declared_noise), channel.unit())
        ),
        Warning::ScaledChannel(evidence) => describe_scaled_sensor(evidence),
        Warning::SwappedChannels(evidence) => describe_swapped_sensors(evidence),
        Warning::LateChannel { channel, lag_s, jumps } => sentence!(
            "{} moves {}{} the other channels at the jumps (all {} together): its clock or filter differs; correct its times",
            *channel,
            number(lag_s.abs(), 1),
            if *lag_s > 0.0 { " s after" } else { " s before" },
            *jumps
        ),
        Warning::ContradictedChannel { faults } | Warning::OffTheNominalMap { faults } => {
            contradiction(faults)
        }
        Warning::StepsContradict(conflict) => steps_contradict(conflict),
        Warning::LostSamples { lost, samples } => {
            sentence!("{} of {} samples in the window were lost and are omitted", *lost, *samples)
        }
        Warning::Outliers { count } => {
            sentence!("samples far from their neighbours, omitted: {}", *count)
        }
        Warning::Calibration { channel, sensor, defect } => calibration(*channel, sensor, defect),
        Warning::EndState { channel, lost_before_end_s } => sentence!(
            "{} was lost {} s before the step's end; its last values are used",
            *channel,
            number(*lost_before_end_s, 1)
        ),
        _ => return None,
    })
}

fn calibration(channel: Channel, sensor: &str, defect: &CalibrationDefect) -> Sentence {
    match defect {
        CalibrationDefect::Missing { key } if key == "calibration" => {
            sentence!("{} has no calibration", sensor)
        }
        CalibrationDefect::Missing { key } => {
            sentence!("the calibration of {} has no `{}`", sensor, key.clone())
        }
        CalibrationDefect::Expired { due, day } => sentence!(
            "the calibration of {} was valid until {}, and the run is on {}",
            sensor,
            due.clone(),
            day.clone()
        ),
        CalibrationDefect::Range { reading, min, max } => {
            let (zero, scale, unit) = match channel.info().dimension {
                Dimension::Temperature => (273.15, 1.0, "degC"),
                Dimension::Pressure => (0.0, 1e-3, "kPa"),
                Dimension::RotationalSpeed => (0.0, 1e-3, "krpm"),
                Dimension::MassFlow => (0.0, 1e3, "g/s"),
                Dimension::Ratio => (0.0, 1.0, ""),
            };
            let shown = |value: f64| number(scale * (value - zero), 1);
            let text = "{} reads {} {}, outside its calibrated range of {} to {} {}";
            sentence!(text, sensor, shown(*reading), unit, shown(*min), shown(*max), unit)
        }
        CalibrationDefect::Uncertainty { certified, declared } => sentence!(
            "the certificate of {} has a standard uncertainty of {}, and offset and gain are declared as {}",
            sensor,
            with_unit(four_figures(*certified), channel.unit()),
            with_unit(four_figures(*declared), channel.unit())
        ),
    }
}

fn describe_scaled_sensor(evidence: &Scaled) -> Sentence {
    match evidence {
        Scaled::SpecificSpeed { speed_rpm, flow_kg_s, pressure_ratio, specific_speed } => sentence!(
            "N, m_c and P2/P1 do not match: {} krpm, {} g/s and a pressure ratio of {} (medians) make a specific speed of {}; radial compressors have 0.3 to 2: check the units of N (rpm, not 1/s) and m_c, and that P1 and P2 are absolute",
            number(speed_rpm / 1e3, 4),
            number(flow_kg_s * 1e3, 4),
            number(*pressure_ratio, 3),
            number(*specific_speed, 3)
        ),
        Scaled::ApparentEfficiency { rise_k, t1_k, pressure_ratio, isentropic_rise_k, efficiency } => {
            sentence!(
                "T2 - T1 is {} K; compression from {} K by a pressure ratio of {} takes {} K without losses (medians). This is an \
                     apparent efficiency of {}; compressors have 0.3 to 0.85: T1, T2, P1 or P2 is scaled, exchanged or in another unit",
                number(*rise_k, 1),
                number(*t1_k, 1),
                number(*pressure_ratio, 3),
                number(*isentropic_rise_k, 1),
                number(*efficiency, 2)
            )
        }
        Scaled::SomePoints => sentence!(
            "no compressor has this T2 - T1 at this pressure ratio (apparent efficiency outside 0.2 to 1.6): T1, T2, P1 or P2 failed there"
        ),
        Scaled::ShaftPower { compressor_w, turbine_w, power_ratio } => sentence!(
            "the compressor takes {} kW and the exhaust gas gives {} kW (medians; the ratio is {}, usually 0.5 to 1): m_c, T1 or T2, or \
                 else m_t, T3 or T4, is scaled or in another unit",
            number(compressor_w / 1e3, 2),
            number(turbine_w / 1e3, 2),
            number(*power_ratio, 2)
        ),
    }
}

fn describe_swapped_sensors(evidence: &Swapped) -> Sentence {
    match evidence {
        Swapped::P2BelowP1 { points, of, p1_pa, p2_pa } => sentence!(
            "P2 lies below P1 at {} of {} points (medians {} and {} kPa): the channels are exchanged, P2 is a gauge pressure, or one of \
                 them is dead; correct the channel map",
            *points,
            *of,
            number(p2_pa / 1e3, 1),
            number(p1_pa / 1e3, 1)
        ),
        Swapped::T2AboveT3 => sentence!(
            "at most points T2 is above T3 and above the temperature that the pressure ratio can produce: the channels are exchanged; correct the \
                 channel map"
        ),
        Swapped::TcBeforeT2 { tc_jump_k, t2_jump_k } => sentence!(
            "Tc changes by {} K within some seconds of a jump and T2 by {} K (medians), but no housing is faster than its gas: the \
                 channels are exchanged; correct the channel map",
            number(*tc_jump_k, 1),
            number(*t2_jump_k, 1)
        ),
    }
}

fn contradiction(faults: &[SuspectedFault]) -> Sentence {
    let start =
        sentence!("conditions, valve, head, heat of the housing and efficiencies do not agree unless ");
    let with_faults = faults.iter().enumerate().fold(start, |text, (index, fault)| {
        let joint = if index == 0 { "" } else { ", and " };
        text.then(joint.to_owned().into()).then(describe_suspected_fault(fault))
    });
    with_faults.then(match faults.iter().any(|fault| fault.touches_points) {
        true => sentence!(": compare the channels at standstill (`zero`) and with the barometer, and repair the sensor, declare its \
             uncertainty or correct the declared conditions (`boundary`)"),
        false => sentence!("; no point depends on it"),
    })
}

fn describe_suspected_fault(fault: &SuspectedFault) -> Sentence {
    let (scale, unit) = match fault.unit.as_str() {
        "1" => (100.0, "%"),
        "Pa" => (1e-3, "kPa"),
        "kg/s" => (1e3, "g/s"),
        "rpm" => (1e-3, "krpm"),
        other => (1.0, other),
    };
    let alternatives = match fault.alternatives.as_slice() {
        [] => String::new(),
        others => format!(" (or: {})", others.join("; ")),
    };
    sentence!(
        "the {}{}{} +/- {} {}{}",
        fault.fault.clone(),
        if fault.channels.is_empty() { " is off its declaration by " } else { " is " },
        signed(scale * fault.value, 2),
        number(1.96 * scale * fault.sigma, 2),
        unit,
        alternatives
    )
}

/// Steps and times are words: each conflict is its own.
fn steps_contradict(conflict: &StepConflict) -> Sentence {
    Sentence::from(match conflict {
        StepConflict::Overlap { first, first_start_s, first_end_s, second, second_start_s, second_end_s } => {
            format!(
                "step {first} ({first_start_s:.1} s to {first_end_s:.1} s) and step {second} ({second_start_s:.1} s to {second_end_s:.1} s) \
                 overlap, and a rig is at one point at a time: correct the step marks"
            )
        }
        StepConflict::SharedNumber { number, steps } => {
            format!(
                "{steps} steps have the number {number}, so their results cannot be distinguished: give each its own"
            )
        }
    })
}
