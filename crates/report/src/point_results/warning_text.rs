//! Sentences of the warnings about points.

use crate::document::{Sentence, number, sentence, signed};
use crate::formatting::{Message, four_figures};
use mapper_core::{
    Bound, CalibrationDefect, Channel, Dimension, EndEvidence, EtaSignal, FitFailure, Implausible, LeftOut,
    MapRegion, ModelDoubt, ModelEvidence, NoCompression, PoorFit, Scaled, StepConflict, SuspectedFault,
    Swapped, TooFew, Warning, WideInterval, with_unit,
};

impl Message for Warning {
    fn message(&self) -> String {
        sentence_of(self).to_string()
    }
}

impl Message for ModelDoubt {
    fn message(&self) -> String {
        model_doubt(self).to_string()
    }
}

pub(crate) fn sentence_of(warning: &Warning) -> Sentence {
    let sentence =
        reading_sentence(warning).or_else(|| step_sentence(warning)).or_else(|| fit_sentence(warning));
    sentence.unwrap_or_else(|| match warning {
        Warning::Other { message, .. } if !message.is_empty() => message.clone().into(),
        other => other.code().to_owned().into(),
    })
}

fn fit_sentence(warning: &Warning) -> Option<Sentence> {
    Some(match warning {
        Warning::SmallGradient { dt2_k, needed_dt2_k, eta_sigma } => sentence!(
            "T2 changes by {} K in the window, less than the {} K that separate efficiency from heat transfer; eta is uncertain by {} \
                 points (1 sigma): come to this point by a larger jump",
            signed(*dt2_k, 2),
            needed_dt2_k.to_string(),
            number(100.0 * eta_sigma, 1)
        ),
        Warning::OffsetsDominate(interval) => describe_wide_interval(interval, true),
        Warning::NoiseDominates(interval) => describe_wide_interval(interval, false),
        Warning::PriorDominated { eta_error } => sentence!(
            "the recording alone determines the efficiencies only to {} points; the remainder depends on the declared alpha_A, probe and \
                 heating/cooling ratio: record longer steps or larger gradients, or set known ones to `fixed` in `identification.joint`",
            number(100.0 * eta_error, 1)
        ),
        Warning::AssumedAlpha { alpha_area_ratio, alpha_area_sigma_ratio, eta_sigma } => sentence!(
            "alpha_A is assumed to be {} within {} (1 sigma), which makes eta uncertain by {} points; `joint` finds it",
            alpha_area_ratio.to_string(),
            alpha_area_sigma_ratio.to_string(),
            number(100.0 * eta_sigma, 1)
        ),
        Warning::NothingDeclared => {
            sentence!("no sensor uncertainty is declared: the interval contains only noise")
        }
        Warning::LeftOut(reason) => describe_left_out(reason),
        Warning::OffTheLaw { h_deviation_ratio } => sentence!(
            "h lies {} % off the law that the other points follow",
            signed(100.0 * h_deviation_ratio, 1)
        ),
        Warning::ModelDoubted(doubt) => model_doubt(doubt),
        _ => return None,
    })
}

fn describe_wide_interval(interval: &WideInterval, from_offsets: bool) -> Sentence {
    let WideInterval { eta_noise_sigma, eta_bias_sigma, signal } = interval;
    let all = number(100.0 * eta_noise_sigma.hypot(*eta_bias_sigma), 1);
    let (cause, other, other_sigma) = match (from_offsets, signal) {
        (true, EtaSignal::Transient { shared: true, .. }) => {
            ("declared offsets and shared parameters make", "noise alone", eta_noise_sigma)
        }
        (true, _) => ("declared offsets make", "noise alone", eta_noise_sigma),
        (false, _) => ("noise makes", "without it", eta_bias_sigma),
    };
    let errors = sentence!(
        "{} eta uncertain by {} points (1 sigma, {} {})",
        cause,
        all,
        other,
        number(100.0 * other_sigma, 1)
    );
    match signal {
        EtaSignal::Transient { dt2_k, .. } => {
            sentence!("T2 changes by {} K in the window; ", signed(*dt2_k, 1)).then(errors)
        }
        EtaSignal::Settled { rise_k } => {
            errors.then(sentence!(" at a temperature rise of {} K", number(*rise_k, 2)))
        }
    }
    .then(match (from_offsets, signal) {
        (true, EtaSignal::Transient { shared: true, .. }) => sentence!(
            ": begin with a `zero`; after one, set known parameters to `fixed` in `identification.joint`, or calibrate and declare smaller offsets"
        ),
        (true, _) => sentence!(": begin with a `zero`, or calibrate and declare smaller offsets"),
        (false, EtaSignal::Transient { .. }) => {
            sentence!(": longer dwell, or come to this point by a larger jump")
        }
        (false, EtaSignal::Settled { .. }) => {
            sentence!(": average over longer, or reduce the noise of the sensors")
        }
    })
}

fn describe_left_out(reason: &LeftOut) -> Sentence {
    match reason {
        LeftOut::PoorFit => {
            sentence!("this step fits far worse than the others and is excluded from the shared parameters")
        }
        LeftOut::Readings => {
            sentence!("this step is excluded from the shared parameters, and has no numbers of its own")
        }
        LeftOut::Region { region, sigmas, doubts } => {
            let region = match region {
                MapRegion::Choke => "near choke",
                MapRegion::Surge => "near surge",
                MapRegion::LowestSpeeds => "at the lowest speeds",
                MapRegion::HighestSpeeds => "at the highest speeds",
            };
            let start = sentence!(
                "the steps {} disagree with all others on the shared parameters ({} standard errors; with them, ",
                region.to_owned(),
                number(*sigmas, 0)
            );
            let listed = doubts.iter().enumerate().fold(start, |text, (index, doubt)| {
                text.then(Sentence::new(if index == 0 { "" } else { "; " }, Vec::new()))
                    .then(model_doubt(doubt))
            });
            listed.then(sentence!("): they are excluded from these"))
        }
    }
}

fn model_doubt(doubt: &ModelDoubt) -> Sentence {
    match &doubt.evidence {
        ModelEvidence::SlowResidual { residual_ratio } => sentence!(
            "the residual of T2 over all steps has a shape: its slow part is {} times that of the declared noise",
            number(*residual_ratio, 2)
        ),
        ModelEvidence::Scatter { scatter_ratio } => {
            sentence!("the points scatter by {} % about the convection law", number(100.0 * scatter_ratio, 1))
        }
        ModelEvidence::Housing { residual_ratio, heat_w } => sentence!(
            "the housing is not one, two or three masses: the slow part of Tc's residual is {} times that of the declared noise, and the heat \
             balances of the steps are off by {} W",
            number(*residual_ratio, 2),
            number(*heat_w, 1)
        ),
        ModelEvidence::Eta { points, max_eta } => sentence!(
            "the efficiency is above {} at {} points, which no turbocharger's compressor reaches",
            number(*max_eta, 2),
            *points
        ),
    }
}

fn reading_sentence(warning: &Warning) -> Option<Sentence> {
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
    let faults_found =
        faults.iter().enumerate().fold(Sentence::from(String::new()), |text, (index, fault)| {
            let joint = if index == 0 { "" } else { ", and " };
            text.then(joint.to_owned().into()).then(describe_suspected_fault(fault))
        });
    let at_rest = faults.iter().find_map(|fault| Some((fault, fault.at_rest?)));
    let evidence = match at_rest {
        Some((_, rest)) => sentence!(
            ": from {} to {} s the machine rests, and sensors that must then read the same do not; ",
            number(rest.start_s, 0),
            number(rest.end_s, 0)
        ),
        None => sentence!(
            ": without this, conditions, valve, head, heat of the housing and efficiencies contradict each other; "
        ),
    };
    faults_found.then(evidence).then(match faults.iter().any(|fault| fault.touches_points) {
        true if let Some((fault, rest)) = at_rest => offset_remedy(fault, rest.is_soak),
        true => sentence!(
            "compare the channels at standstill (`zero`) and with the barometer, and repair the sensor, declare its uncertainty or correct the \
             declared conditions (`boundary`)"
        ),
        false => match at_rest {
            Some((fault, rest)) => {
                sentence!("only the turbine's points depend on it; ").then(offset_remedy(fault, rest.is_soak))
            }
            None => sentence!("no point depends on it"),
        },
    })
}

fn offset_remedy(fault: &SuspectedFault, is_soak: bool) -> Sentence {
    let ([channel], "K" | "Pa") = (fault.channels.as_slice(), fault.unit.as_str()) else {
        return sentence!("repair the sensors, or declare their uncertainty");
    };
    let offset = with_unit(four_figures(fault.value.abs()), &fault.unit);
    let declared = format!("repair the sensor, or declare `sensors: {channel}: {{offset: {offset}}}`");
    Sentence::from(match is_soak {
        true => format!("{declared}, and `zero: {{soak: 10 min}}` subtracts what it reads at rest"),
        false => declared,
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

/// Advice if the model does not fit.
const POOR_FIT_REMEDY: &str = ": declare the noise and the probe that T2 really has; `joint` finds probe and alpha_A, `mapper gap` looks \
     for other causes";

fn step_sentence(warning: &Warning) -> Option<Sentence> {
    Some(match warning {
        Warning::NoTransient => {
            sentence!("no jump leads to this step, so it has no transient; the dynamic method needs one")
        }
        Warning::FromConvectionLaw { convection_origin: None } => {
            sentence!("no jump leads to this step: its efficiency comes from the shared parameters")
        }
        Warning::FromConvectionLaw { convection_origin: Some(origin) } => {
            sentence!("heat removed by eqs. 1-3 with the convection law {}", origin.clone())
        }
        Warning::TooFewSamples(reason) => too_few(reason),
        Warning::WindowCut { requested_end_s, step_s } => sentence!(
            "the window was to end {} s after the jump; the step ends after {} s",
            number(*requested_end_s, 1),
            number(*step_s, 1)
        ),
        Warning::NotStabilised { quantity, settled_s, needed_s, used_s } => {
            let varies = sentence!(
                "the {} still varies beyond its limit {} s before the step's end; it must settle {} s before the end: a longer dwell",
                quantity.clone(),
                number(*settled_s, 0),
                number(*needed_s, 0)
            );
            match used_s {
                Some(used_s) => varies.then(sentence!("; the last {} s are used", number(*used_s, 0))),
                None => varies,
            }
        }
        Warning::NotSettled { channel, drift_k_min, limit_k_min } => sentence!(
            "{} still drifts by {} K/min at the step's end (limit {}): the temperatures have not settled",
            *channel,
            signed(*drift_k_min, 2),
            number(*limit_k_min, 2)
        ),
        Warning::FlowMoved { flow_change_ratio, eta_error, h_error_w_m2k } => sentence!(
            "the flow changed by {} % in the window and h with it, which the method assumes to be constant: eta is about {} points off, h \
                 about {} W/(m2 K)",
            signed(100.0 * flow_change_ratio, 1),
            signed(100.0 * eta_error, 1),
            signed(*h_error_w_m2k, 0)
        ),
        Warning::SpeedNotReached { requested_rpm, reached_rpm } => sentence!(
            "{} krpm were requested and {} krpm reached",
            number(requested_rpm / 1e3, 2),
            number(reached_rpm / 1e3, 2)
        ),
        Warning::Apparent => sentence!("apparent efficiency: heat exchanged with the housing counts as work"),
        Warning::SurgeEnd { evidence } => {
            sentence!("the surge side of its line ends here: {}", end(*evidence))
        }
        Warning::ChokeEnd { evidence } => sentence!("the line is choked from here on: {}", end(*evidence)),
        Warning::NoCompression(reason) => no_compression(reason),
        Warning::AtBound(Bound::Eta { eta }) => sentence!(
            "the best fit puts the efficiency at {}, a bound of the search; no number is given",
            number(*eta, 3)
        ),
        Warning::AtBound(Bound::H { h_w_m2k }) => sentence!(
            "the best fit puts the heat-transfer coefficient at {} W/(m2 K), a bound of the search; no number is given",
            number(*h_w_m2k, 0)
        ),
        Warning::FitFailed(FitFailure::Step) => {
            sentence!("least squares for efficiency and heat-transfer coefficient did not converge")
        }
        Warning::FitFailed(FitFailure::AllSteps) => {
            sentence!("least squares over all steps did not converge: this step was identified separately")
        }
        Warning::FitFailed(FitFailure::NotFinite) => {
            sentence!("the fit gives no finite number for this step")
        }
        Warning::PoorFit(evidence) => poor_fit(evidence),
        _ => return None,
    })
}

fn too_few(reason: &TooFew) -> Sentence {
    match reason {
        TooFew::ShortStep { step_s } => sentence!(
            "the step lasts {} s, which leaves no room for a window after its jump",
            number(*step_s, 1)
        ),
        TooFew::LateCommands { before_end_s } => {
            sentence!("the commands changed until {} s before the step's end", number(*before_end_s, 1))
        }
        TooFew::Samples { complete, lost, needed } => sentence!(
            "{} complete samples in the window ({} lost); at least {} are needed",
            *complete,
            *lost,
            *needed
        ),
    }
}

fn end(evidence: EndEvidence) -> &'static str {
    match evidence {
        EndEvidence::Named => "its row names it",
        EndEvidence::ZeroSlope => "the pressure ratio does not rise towards smaller flow",
        EndEvidence::Efficiency => "the efficiency falls below 58 %",
        EndEvidence::Vertical => "the pressure ratio falls without more flow",
        EndEvidence::NotReached => "it is the outermost point",
    }
}

fn no_compression(reason: &NoCompression) -> Sentence {
    match reason {
        NoCompression::NoT2 => {
            sentence!("the table has no T2 at this point: no efficiency can be derived")
        }
        NoCompression::NoRise { rise_k, pressure_ratio } => sentence!(
            "T2 - T1 is {} K at a pressure ratio of {}: no efficiency can be derived",
            number(*rise_k, 2),
            number(*pressure_ratio, 4)
        ),
        NoCompression::NoPressureRise => {
            sentence!("the pressure ratio is 1 or less: nothing is compressed, efficiency has no meaning")
        }
    }
}

fn poor_fit(evidence: &PoorFit) -> Sentence {
    match evidence {
        PoorFit::Eta { eta } => sentence!(
            "the efficiency is {}, which no compressor has: look for a fault of T2 or P2, for cooling, or for another unmodelled effect",
            number(*eta, 3)
        ),
        PoorFit::NoiseRatio { residual_ratio } => sentence!(
            "the residual of T2 is {} times the declared noise: look for a disturbance of T2; if there is none, declare more noise",
            number(*residual_ratio, 1)
        ),
        PoorFit::Noise { residual_k, noise_k } => sentence!(
            "the residual of T2 is {} K rms; the declared noise explains {} K{}",
            number(*residual_k, 3),
            number(*noise_k, 3),
            POOR_FIT_REMEDY
        ),
        PoorFit::Shape { residual_k, block_s, dt2_k } => sentence!(
            "the residual of T2 has a shape: {} K rms in {} s means, while T2 changes by {} K{}",
            number(*residual_k, 3),
            number(*block_s, 0),
            number(*dt2_k, 1),
            POOR_FIT_REMEDY
        ),
    }
}
