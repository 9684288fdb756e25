//! Diagnosis of one side of a machine from a log without steps.

use crate::driven::DrivenError;
use crate::driven::compressor::CompressorSide;
use crate::driven::fit::{SideFit, SideProblem};
use crate::driven::held_out::{beyond, held_out, phases, residual_rms_k};
use crate::driven::search::{diagnosable, probabilities, search, smallest};
use crate::driven::side::{Rows, Side, SideModel, denoised};
use crate::driven::side_diagnosis::{ChannelTrace, Diagnosis, SideCause, SideVerdict, Unknown};
use crate::driven::turbine::TurbineSide;
use crate::gap::best_fit::coordinate::infos;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::probabilities::{candidate, name_of};
use crate::gap::report::{EXCLUDED, MAX_EQUIVALENT};
use mapper_core::{Channel, Recording};
use mapper_identify::MAX_CORRELATED_ROWS;
use mapper_inference::posterior::{RankedCause, is_identified};
use mapper_numerics::statistics::{NORMAL_975, rms};
use mapper_observe::Declared;
use mapper_physics::rig::effect::{Effect, Rig};
use mapper_physics::rig::sensor_fault::{is_only_on_stands, log_effects};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// Inputs of a diagnosis.
pub struct SideRequest<'a> {
    /// The log.
    pub recording: &'a Recording,
    /// The nominal machine with ideal sensors.
    pub nominal: &'a Rig,
    /// Candidate effects.
    pub effects: &'a [Arc<dyn Effect>],
    /// Noise of the sensors.
    pub declared: &'a Declared,
    /// Priors of causes and the evidence threshold.
    pub calibration: &'a Calibration,
    /// End of the fitted part, s; later rows are predicted.
    pub fit_until_s: f64,
    /// The same seed gives the same result.
    pub seed: u64,
}

/// Diagnoses a side.
pub fn diagnose(request: &SideRequest<'_>, side: Side) -> Result<Diagnosis, DrivenError> {
    let effects = request.effects.iter().filter(|effect| !is_only_on_stands(&effect.info().id)).cloned();
    let effects: Vec<_> = effects.chain(log_effects(side == Side::Compressor)).collect();
    let request = &SideRequest { effects: &effects, ..*request };
    match side {
        Side::Compressor => diagnose_side::<CompressorSide>(request),
        Side::Turbine => diagnose_side::<TurbineSide>(request),
    }
}

fn diagnose_side<S: SideModel>(request: &SideRequest<'_>) -> Result<Diagnosis, DrivenError> {
    let all = Rows::read(request.recording, S::CHANNELS)?;
    let (calibration, lost_rows) = (request.calibration, all.lost);
    let rows = denoised(&all, request.declared).thinned(MAX_CORRELATED_ROWS);
    let fitted = rows.t_s.partition_point(|t_s| *t_s < request.fit_until_s);
    // Twice the unknowns.
    let needed = 2 * S::UNKNOWNS.len();
    if fitted < needed {
        let (rows, until_s) = (fitted, request.fit_until_s);
        return Err(DrivenError::TooFewRows { rows, until_s, needed });
    }
    let counts: Vec<bool> = (0..rows.len()).map(|i| i < fitted).collect();
    let side = S::of(rows);
    let mut problem =
        SideProblem { side: &side, nominal: request.nominal, effects: request.effects, white_k: Vec::new() };
    problem.white_k = white_k(&problem, &all, request).ok_or(DrivenError::NoAnswer)?;
    let (diagnosable, mut not_diagnosable) = diagnosable(&problem);
    let found = search(&problem, &diagnosable, &counts, calibration).ok_or(DrivenError::NoAnswer)?;
    let posterior = probabilities(calibration, diagnosable.len(), &found);
    let open = posterior.alike;
    let fit_of = |place: usize| &found.fits[posterior.causes[place].set];
    let listed = |cause: &&RankedCause| cause.probability >= EXCLUDED;
    let causes = posterior.causes.iter().take_while(listed).count().max(open);
    // Held-out phases test it, even if a cause outside the library is more probable.
    let likeliest = if posterior.named && causes > 0 { fit_of(0) } else { &found.null };
    let choices: Vec<&SideFit> =
        (0..if posterior.named { causes.min(1 + MAX_EQUIVALENT) } else { 0 }).map(fit_of).collect();
    let open_effects: Vec<usize> = (0..open)
        .flat_map(|place| fit_of(place).hypothesis.effects.iter().map(|(effect, _)| *effect))
        .collect();
    let rows = side.rows();
    let drives = [S::CHANNELS.drives[0], S::PRESSURE];
    let phases = phases(rows, fitted, &drives);
    let held_out = held_out(&problem, &phases, &found.null, &choices, calibration, diagnosable.len());
    // Noise of the drives can imitate an effect in the fitted part, but not in held-out phases.
    let is_confirmed = held_out.as_ref().is_none_or(|phases| phases.after_k < phases.before_k);
    let word = match open {
        _ if posterior.unmodelled > 0.5 => SideVerdict::Outside,
        0 => SideVerdict::WithinTolerance,
        _ if !is_confirmed => SideVerdict::NotBorneOut,
        1 => SideVerdict::Named,
        _ => SideVerdict::NotDistinguished,
    };
    let (asked, undetectable) =
        smallest(&problem, &diagnosable, likeliest, &open_effects, &counts, calibration);
    not_diagnosable.extend(undetectable);
    let symbols =
        |columns: &[(Channel, Vec<f64>)]| columns.iter().map(|(channel, _)| channel.symbol()).collect();
    let measured = |(_, column): &&(Channel, Vec<f64>)| column.iter().any(|k| k.is_finite());
    Ok(Diagnosis {
        side: S::SIDE,
        driven_by: symbols(&rows.drives),
        judged: rows.judged.iter().filter(measured).map(|(channel, _)| channel.symbol()).collect(),
        fitted_until_s: request.fit_until_s,
        word,
        probability_none: posterior.none,
        probability_outside: posterior.unmodelled,
        causes: (0..causes)
            .map(|place| cause(&problem, calibration, fit_of(place), posterior.causes[place].probability))
            .collect(),
        open,
        before_k: residual_rms_k(&problem, &found.null.predicted, 0..fitted),
        after_k: residual_rms_k(&problem, &likeliest.predicted, 0..fitted),
        held_out,
        beyond: beyond(&problem, fitted, &found.null, likeliest, request.seed),
        asked,
        not_asked: not_diagnosable,
        unknowns: unknowns::<S>(likeliest),
        time_history: ChannelTrace {
            t_s: rows.t_s.clone(),
            read_k: rows.judged[0].1.clone(),
            before_k: found.null.predicted[0].clone(),
            after_k: likeliest.predicted[0].clone(),
        },
        lost_rows,
    })
}

/// White noise of each judged channel, K: of its sensor, and of the denoised drives through the model.
fn white_k<S: SideModel>(
    problem: &SideProblem<'_, S>,
    all: &Rows,
    request: &SideRequest<'_>,
) -> Option<Vec<f64>> {
    let declared = request.declared;
    let mut random = Pcg64Mcg::seed_from_u64(request.seed.wrapping_add(2));
    let mut noisy = denoised(all, declared);
    for (channel, column) in &mut noisy.drives {
        let sigma = declared.noise_sigma(*channel);
        for value in column {
            let z: f64 = StandardNormal.sample(&mut random);
            *value += sigma * z;
        }
    }
    let noisy = denoised(&noisy, declared).thinned(MAX_CORRELATED_ROWS);
    let with_noise = SideProblem { side: &S::of(noisy), white_k: Vec::new(), ..*problem };
    let (quiet, noisy) = (problem.predict(&problem.nothing())?, with_noise.predict(&problem.nothing())?);
    let sigma_k = |(index, (channel, _)): (usize, &(Channel, Vec<f64>))| {
        let by_drives_k = rms(quiet[index].iter().zip(&noisy[index]).map(|(q, n)| n - q)).unwrap_or(0.0);
        declared.noise_sigma(*channel).hypot(by_drives_k)
    };
    Some(problem.side.rows().judged.iter().enumerate().map(sigma_k).collect())
}

fn cause<S: SideModel>(
    problem: &SideProblem<'_, S>,
    calibration: &Calibration,
    fit: &SideFit,
    probability: f64,
) -> SideCause {
    let infos: Vec<_> = infos(problem.effects, &fit.hypothesis).collect();
    let unknowns = fit.hypothesis.nuisances.len();
    let inverse = fit.precision.clone().cholesky().map(|cholesky| cholesky.inverse());
    let covariance = inverse.map(|all| all.remove_rows(0, unknowns).remove_columns(0, unknowns));
    let effects = &fit.hypothesis.effects;
    let with_values = infos.iter().zip(effects).flat_map(|(info, (_, values))| {
        info.parameters.iter().zip(values).map(move |(parameter, value)| (info, parameter, value))
    });
    let at_the_end = with_values
        .filter(|(_, p, value)| [p.low, p.high].contains(value) && **value != p.neutral)
        .map(|(info, parameter, _)| name_of(info, parameter))
        .collect();
    SideCause {
        candidate: candidate(calibration, problem.effects, &fit.hypothesis, covariance.as_ref(), probability),
        at_the_end,
        model_error_sigma_k: fit.model_error_sigma_k.clone(),
    }
}

fn unknowns<S: SideModel>(fit: &SideFit) -> Vec<Unknown> {
    let covariance = fit.precision.clone().cholesky().map(|cholesky| cholesky.inverse());
    let each = S::UNKNOWNS.iter().zip(&fit.hypothesis.nuisances).enumerate();
    each.map(|(place, (unknown, z))| {
        let sigma = covariance.as_ref().map_or(1.0, |c| c[(place, place)].max(0.0).sqrt());
        let ends = |middle: f64, sigma: f64| {
            (unknown.at(middle - NORMAL_975 * sigma), unknown.at(middle + NORMAL_975 * sigma))
        };
        let ((low, high), (prior_low, prior_high)) = (ends(*z, sigma), ends(0.0, 1.0));
        let identified = is_identified(high - low, prior_high - prior_low);
        let (name, description, unit) = (unknown.name, unknown.description, unknown.unit);
        Unknown { name, description, unit, value: unknown.at(*z), low, high, identified }
    })
    .collect()
}
