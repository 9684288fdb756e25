//! Warnings about intervals, and about the fit of all steps.

use crate::point_results::warning_text::sentence::{Sentence, number, sentence, signed};
use mapper_core::{
    EtaSignal, HeatCorrected, LeftOut, MapRegion, ModelDoubt, ModelEvidence, Warning, WideInterval,
};

/// The sentence; `None` for other warnings.
pub(crate) fn sentence_of(warning: &Warning) -> Option<Sentence> {
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
        Warning::HeatCorrected(HeatCorrected::Corrected { apparent_eta }) => sentence!(
            "corrected from an apparent {} % by one heat for the whole map; the interval assumes it known to half its size",
            number(100.0 * apparent_eta, 2)
        ),
        Warning::HeatCorrected(HeatCorrected::TooMuchHeat { heat_w }) => sentence!(
            "without a heat of {} W its efficiency would be above 95 %: it did not take up that much",
            number(*heat_w, 0)
        ),
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

pub(crate) fn model_doubt(doubt: &ModelDoubt) -> Sentence {
    match &doubt.evidence {
        ModelEvidence::SlowResidual { residual_ratio } => sentence!(
            "the residual of T2 over all steps has a shape: its slow part is {} times that of the declared noise",
            number(*residual_ratio, 2)
        ),
        ModelEvidence::Scatter { scatter_ratio } => {
            sentence!("the points scatter by {} % about the convection law", number(100.0 * scatter_ratio, 1))
        }
        ModelEvidence::Eta { points, max_eta } => sentence!(
            "the efficiency is above {} at {} points, which no turbocharger's compressor reaches",
            number(*max_eta, 2),
            *points
        ),
    }
}
