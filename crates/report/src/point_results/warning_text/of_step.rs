//! Warnings about a step: its window, its transient, its own fit.

use crate::point_results::warning_text::sentence::{Sentence, number, sentence, signed};
use mapper_core::{Bound, EndEvidence, FitFailure, NoCompression, PoorFit, TooFew, Warning};

/// Advice if the model does not fit.
const POOR_FIT_REMEDY: &str = ": declare the noise and the probe that T2 really has; `joint` finds probe and alpha_A, `mapper gap` looks \
     for other causes";

/// The sentence; `None` for other warnings.
pub(crate) fn sentence_of(warning: &Warning) -> Option<Sentence> {
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
            "the fitted efficiency is {}, which no compressor has: an unmodelled effect acts",
            number(*eta, 3)
        ),
        PoorFit::NoiseRatio { residual_ratio } => sentence!(
            "the residual of T2 is {} times the declared noise: something disturbed it, or declare more noise",
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
