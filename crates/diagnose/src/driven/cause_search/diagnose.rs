//! Diagnosis of one side of a machine from a log without steps.

use crate::driven::DrivenError;
use crate::driven::cause_search::denoise::calm;
use crate::driven::cause_search::detectable::{audible, smallest};
use crate::driven::cause_search::fit::{Fit, Question};
use crate::driven::cause_search::held_out::{beyond, held_out, ids, off_k};
use crate::driven::cause_search::phases::phases;
use crate::driven::cause_search::search::{search, weigh};
use crate::driven::cause_search::side_diagnosis::{Cause, Course, Diagnosis, Unknown, Word};
use crate::driven::cause_search::sides::compressor::CompressorSide;
use crate::driven::cause_search::sides::side::{Side, Which};
use crate::driven::cause_search::sides::turbine::TurbineSide;
use crate::driven::log_rows::Rows;
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::weigh::{estimates, name_of};
use crate::gap::findings::report::EXCLUDED;
use crate::gap::next_experiment::best_experiment::RIVALS;
use mapper_core::{Channel, Recording};
use mapper_inference::interval::IDENTIFIED_RATIO;
use mapper_numerics::statistics::{NORMAL_975, rms};
use mapper_observe::Declared;
use mapper_physics::rig::effect::{Effect, Rig};
use mapper_physics::rig::sensor_fault::{is_only_on_stands, log_effects};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// Maximum number of rows; more add no information, because the model error is correlated over seconds.
const MAX_ROWS: usize = 800;

/// Inputs of a diagnosis.
pub struct Ask<'a> {
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
///
/// # Errors
/// [`DrivenError::Channel`] if a required channel is missing, [`DrivenError::TooFewRows`] if there are too few rows to fit,
/// [`DrivenError::NoAnswer`] if the nominal machine has no solution under the driving channels.
pub fn diagnose(ask: &Ask<'_>, side: Which) -> Result<Diagnosis, DrivenError> {
    let asked = ask.effects.iter().filter(|effect| !is_only_on_stands(&effect.info().id)).cloned();
    let effects: Vec<_> = asked.chain(log_effects(side == Which::Compressor)).collect();
    let ask = &Ask { effects: &effects, ..*ask };
    match side {
        Which::Compressor => of_side::<CompressorSide>(ask),
        Which::Turbine => of_side::<TurbineSide>(ask),
    }
}

fn of_side<S: Side>(ask: &Ask<'_>) -> Result<Diagnosis, DrivenError> {
    let all = Rows::read(ask.recording, S::wanted())?;
    let (calibration, lost_rows) = (ask.calibration, all.lost);
    let rows = calm(&all, ask.declared).thinned(MAX_ROWS);
    let fitted = rows.t_s.partition_point(|t_s| *t_s < ask.fit_until_s);
    // Twice the unknowns.
    let needed = 2 * S::unknowns().len();
    if fitted < needed {
        let (rows, until_s) = (fitted, ask.fit_until_s);
        return Err(DrivenError::TooFewRows { rows, until_s, needed });
    }
    let counts: Vec<bool> = (0..rows.len()).map(|i| i < fitted).collect();
    let side = S::of(rows);
    let mut question =
        Question { side: &side, nominal: ask.nominal, effects: ask.effects, white_k: Vec::new() };
    question.white_k = white_k(&question, &all, ask).ok_or(DrivenError::NoAnswer)?;
    let (asked, mut not_asked) = audible(&question);
    let found = search(&question, &asked, &counts, calibration).ok_or(DrivenError::NoAnswer)?;
    let posterior = weigh(calibration, asked.len(), &found);
    let fit_of = |place: usize| &found.fits[posterior.causes[place].0];
    let listed = |(_, probability): &&(usize, f64)| *probability >= EXCLUDED;
    let causes = posterior.causes.iter().take_while(listed).count().max(posterior.open);
    // The named cause before the comparison with an unmodelled one; held-out phases judge it.
    let likeliest = if posterior.named && causes > 0 { fit_of(0) } else { &found.null };
    let open = posterior.open;
    let choices: Vec<&Fit> = (0..if posterior.named { causes.min(RIVALS) } else { 0 }).map(fit_of).collect();
    let open_effects: Vec<usize> = (0..open)
        .flat_map(|place| fit_of(place).hypothesis.effects.iter().map(|(effect, _)| *effect))
        .collect();
    let rows = side.rows();
    let drives = [S::wanted().drives[0], S::PRESSURE];
    let phases = phases(rows, fitted, &drives);
    let held_out = held_out(&question, &phases, &found.null, &choices, calibration, asked.len());
    // Noise steps of the drives can imitate an effect in the fitted part, but not in held-out phases.
    let borne_out = held_out.as_ref().is_none_or(|phases| phases.after_k < phases.before_k);
    let word = match open {
        _ if posterior.outside > 0.5 => Word::Outside,
        0 => Word::WithinTolerance,
        _ if !borne_out => Word::NotBorneOut,
        1 => Word::Named,
        _ => Word::NotDistinguished,
    };
    let (asked_for, silent) = smallest(&question, &asked, likeliest, &open_effects, &counts, calibration);
    not_asked.extend(silent);
    let symbols =
        |columns: &[(Channel, Vec<f64>)]| columns.iter().map(|(channel, _)| channel.symbol()).collect();
    let measured = |(_, column): &&(Channel, Vec<f64>)| column.iter().any(|k| k.is_finite());
    Ok(Diagnosis {
        side: S::WHICH,
        driven_by: symbols(&rows.drives),
        judged: rows.judged.iter().filter(measured).map(|(channel, _)| channel.symbol()).collect(),
        fitted_until_s: ask.fit_until_s,
        word,
        probability_none: posterior.none,
        probability_outside: posterior.outside,
        causes: (0..causes)
            .map(|place| cause(&question, calibration, fit_of(place), posterior.causes[place].1))
            .collect(),
        open,
        before_k: off_k(&question, &found.null.predicted, 0..fitted),
        after_k: off_k(&question, &likeliest.predicted, 0..fitted),
        held_out,
        beyond: beyond(&question, fitted, &found.null, likeliest, ask.seed),
        asked: asked_for,
        not_asked,
        unknowns: unknowns::<S>(likeliest),
        course: Course {
            t_s: rows.t_s.clone(),
            read_k: rows.judged[0].1.clone(),
            before_k: found.null.predicted[0].clone(),
            after_k: likeliest.predicted[0].clone(),
        },
        lost_rows,
    })
}

/// White noise of each judged channel: the sensor's, and the response to the drives' residual noise.
fn white_k<S: Side>(question: &Question<'_, S>, all: &Rows, ask: &Ask<'_>) -> Option<Vec<f64>> {
    let declared = ask.declared;
    let mut random = Pcg64Mcg::seed_from_u64(ask.seed.wrapping_add(2));
    let mut noisy = calm(all, declared);
    for (channel, column) in &mut noisy.drives {
        let sigma = declared.noise_sigma(*channel);
        for value in column {
            let z: f64 = StandardNormal.sample(&mut random);
            *value += sigma * z;
        }
    }
    let noisy = calm(&noisy, declared).thinned(MAX_ROWS);
    let there = Question { side: &S::of(noisy), white_k: Vec::new(), ..*question };
    let (quiet, noisy) = (question.predict(&question.nothing())?, there.predict(&question.nothing())?);
    let judged = question.side.rows().judged.iter();
    let of_channel = |((channel, _), (quiet, noisy)): (&(Channel, _), (&Vec<f64>, &Vec<f64>))| {
        let by_drives_k = rms(quiet.iter().zip(noisy).map(|(q, n)| n - q)).unwrap_or(0.0);
        declared.noise_sigma(*channel).hypot(by_drives_k)
    };
    Some(judged.zip(quiet.iter().zip(&noisy)).map(of_channel).collect())
}

fn cause<S: Side>(
    question: &Question<'_, S>,
    calibration: &Calibration,
    fit: &Fit,
    probability: f64,
) -> Cause {
    let infos: Vec<_> =
        fit.hypothesis.effects.iter().map(|(index, _)| question.effects[*index].info()).collect();
    let unknowns = fit.hypothesis.nuisances.len();
    let inverse = fit.precision.clone().cholesky().map(|cholesky| cholesky.inverse());
    let covariance = inverse.map(|all| all.remove_rows(0, unknowns).remove_columns(0, unknowns));
    let effects = &fit.hypothesis.effects;
    let parameters = estimates(calibration, question.effects, effects, covariance.as_ref());
    let with_values = infos.iter().zip(effects).flat_map(|(info, (_, values))| {
        info.parameters.iter().zip(values).map(move |(parameter, value)| (info, parameter, value))
    });
    let at_the_end = with_values
        .filter(|(_, p, value)| [p.low, p.high].contains(value) && **value != p.neutral)
        .map(|(info, parameter, _)| name_of(info, parameter))
        .collect();
    Cause {
        effects: ids(question, &fit.hypothesis),
        names: infos.iter().map(|info| info.name.to_string()).collect(),
        probability,
        parameters,
        at_the_end,
        left_k: fit.left_k.clone(),
    }
}

fn unknowns<S: Side>(fit: &Fit) -> Vec<Unknown> {
    let covariance = fit.precision.clone().cholesky().map(|cholesky| cholesky.inverse());
    let each = S::unknowns().iter().zip(&fit.hypothesis.nuisances).enumerate();
    each.map(|(place, (unknown, z))| {
        let sigma = covariance.as_ref().map_or(1.0, |c| c[(place, place)].max(0.0).sqrt());
        let ends = |middle: f64, sigma: f64| {
            (unknown.at(middle - NORMAL_975 * sigma), unknown.at(middle + NORMAL_975 * sigma))
        };
        let ((low, high), (prior_low, prior_high)) = (ends(*z, sigma), ends(0.0, 1.0));
        let identified = high - low < IDENTIFIED_RATIO * (prior_high - prior_low);
        let (name, description, unit) = (unknown.name, unknown.description, unknown.unit);
        Unknown { name, description, unit, value: unknown.at(*z), low, high, identified }
    })
    .collect()
}
