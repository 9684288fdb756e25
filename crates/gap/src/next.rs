//! What to do next: the jump that separates the remaining candidates best, or the sensor that would.

use crate::fit::Fit;
use crate::outlook::{AllowedJump, apart, apart_at_first_sight, recorded_jumps, recorded_points};
use crate::report::{JumpPoint, Next, Place};
use crate::study::Study;
use mapper_core::OperatingPoint;
use mapper_numerics::parallel;
use mapper_physics::effect::Submodel;

/// A further jump of which one learns less than this, in squared sigmas, is not worth its minutes.
const LEAST_DISCRIMINATION: f64 = 1.0;
/// Jumps that are looked at closely.
const CLOSE_LOOKS: usize = 6;
/// Candidates that are told apart.
const RIVALS: usize = 4;

/// The candidates that are still open, best first, and their probabilities.
pub struct Rivals<'a> {
    /// At least two fits; the first is the best.
    pub fits: Vec<&'a Fit>,
    /// As many probabilities.
    pub probabilities: Vec<f64>,
}

/// The jump that tells the rivals apart best for each minute.
///
/// `U = sum over k, j of p_k p_j d_kj^2 / minutes`, with `d_kj^2` by how much the jump would raise the misfit of `j`,
/// fitted again, were `k` true. All `allowed` jumps are looked at with the candidates as they stand, the most promising
/// of them with each rival fitted again. Without allowed jumps those of the recording are taken, to be repeated. Where
/// no jump shows enough, the sensor beside the part in which the first candidate sits is named.
pub fn next(study: &Study, mut rivals: Rivals<'_>, allowed: &[AllowedJump]) -> Option<Next> {
    rivals.fits.truncate(RIVALS);
    rivals.probabilities.truncate(RIVALS);
    let first = *rivals.fits.first()?;
    let recorded;
    let jumps = if allowed.is_empty() {
        recorded = recorded_jumps(study, &recorded_points(study, &first.hypothesis));
        recorded.as_slice()
    } else {
        allowed
    };
    let rate = |jump: &AllowedJump, apart: &[Vec<f64>]| gain(&rivals.probabilities, apart) / minutes(jump);
    let looks = parallel::map(jumps, |jump| {
        let apart = apart_at_first_sight(study, jump, &rivals.fits)?;
        Some((rate(jump, &apart), *jump))
    });
    let mut looks: Vec<(f64, AllowedJump)> = looks.into_iter().flatten().collect();
    looks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let close: Vec<AllowedJump> = looks.into_iter().take(CLOSE_LOOKS).map(|(_, jump)| jump).collect();
    let looked = parallel::map(&close, |jump| Some((*jump, apart(study, jump, &rivals.fits)?)));
    let best = looked.into_iter().flatten().max_by(|a, b| rate(&a.0, &a.1).total_cmp(&rate(&b.0, &b.1)));
    let nearest = |apart: &[Vec<f64>]| apart[0].iter().skip(1).copied().fold(f64::INFINITY, f64::min);
    match best {
        Some((jump, apart)) if nearest(&apart) >= LEAST_DISCRIMINATION => Some(Next::Jump {
            from: point(jump.from),
            to: point(jump.to),
            expected_probability: settled(&rivals.probabilities, &apart),
            minutes: minutes(&jump),
        }),
        other => {
            let (effect, _) = rivals.fits.iter().find_map(|fit| fit.hypothesis.effects.first())?;
            let sigma = other.map_or(0.0, |(_, apart)| nearest(&apart).sqrt());
            let among = if allowed.is_empty() { "recorded" } else { "allowed" };
            Some(Next::Sensor {
                sensor: sensor_for(study.effects[*effect].info().submodel).to_owned(),
                reason: format!(
                    "none of the {} {among} jumps separates the first candidates by more than {sigma:.1} sigma",
                    jumps.len()
                ),
            })
        }
    }
}

/// The step that is left where the catalogue does not explain the gap: the sensor that would look into the part where most of it
/// lies, or where no part is known, a suspicion.
pub fn look_beside(places: &[Place]) -> Next {
    let place = places.first();
    let part = place.and_then(|place| Submodel::ALL.into_iter().find(|part| part.name() == place.submodel));
    let (sensor, lies) = match part {
        Some(part) => (sensor_for(part), format!("most of it lies in {}", part.name())),
        None => {
            ("a second thermocouple in the compressor housing, near the gas", "no part stands out".to_owned())
        }
    };
    Next::Sensor {
        sensor: sensor.to_owned(),
        reason: format!(
            "no effect of the catalogue explains all of the gap, and {lies}: write a suspected effect in rhai and give it with --effect, or measure there"
        ),
    }
}

fn point(point: OperatingPoint) -> JumpPoint {
    JumpPoint { speed_rpm: point.speed_rpm, valve: point.valve_opening_ratio }
}

fn minutes(jump: &AllowedJump) -> f64 {
    (jump.dwell_s / 60.0).max(0.1)
}

/// `sum p_k p_j d_kj^2`.
fn gain(probabilities: &[f64], apart: &[Vec<f64>]) -> f64 {
    let row = |(p, row): (&f64, &Vec<f64>)| -> f64 {
        row.iter().zip(probabilities).map(|(d2, q)| p * q * d2).sum::<f64>()
    };
    probabilities.iter().zip(apart).map(row).sum()
}

/// Probability that the true one of the rivals is expected to have after the jump: the odds of `k` over `j` grow by
/// `exp(d_kj^2/2)` if `k` is true.
fn settled(probabilities: &[f64], apart: &[Vec<f64>]) -> f64 {
    let total: f64 = probabilities.iter().sum();
    let after = |(k, p): (usize, &f64)| {
        let weights: f64 =
            probabilities.iter().zip(&apart[k]).map(|(q, d2)| q * (-0.5 * d2).exp()).sum::<f64>();
        p / total * (p / weights)
    };
    probabilities.iter().enumerate().map(after).sum::<f64>().clamp(0.0, 1.0)
}

/// A sensor that would look into a part directly.
fn sensor_for(part: Submodel) -> &'static str {
    match part {
        Submodel::Actuator | Submodel::TurbineFlow => "a second, fast pressure sensor at the turbine inlet",
        Submodel::Shaft => "oil outlet temperature and oil flow, for the bearings' power",
        Submodel::CompressorFlow | Submodel::FlowMeter => "a second flow meter in the compressor's line",
        Submodel::Outlet | Submodel::P2Sensor => "a second pressure sensor at the compressor outlet",
        Submodel::CompressorGas => "a gas temperature probe between the wheel and the volute",
        Submodel::T1Probe => "a second probe at the compressor inlet",
        Submodel::T2Probe => "a second T2 probe of another diameter",
        Submodel::TcProbe | Submodel::CompressorHousing => {
            "a second thermocouple in the compressor housing, near the gas"
        }
        Submodel::TurbineHousing => "thermocouples on both sides of the bearing housing",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_that_shows_nothing_settles_nothing_and_one_that_shows_all_settles_all() {
        let probabilities = [0.6, 0.3, 0.1];
        let apart = |d2: f64| -> Vec<Vec<f64>> {
            (0..3).map(|k| (0..3).map(|j| if k == j { 0.0 } else { d2 }).collect()).collect()
        };
        // Without news the true one keeps its own probability: sum of p^2.
        assert!((settled(&probabilities, &apart(0.0)) - 0.46).abs() < 1e-12);
        assert!(settled(&probabilities, &apart(100.0)) > 1.0 - 1e-9);
        let some = settled(&probabilities, &apart(4.0));
        assert!(some > 0.46 && some < 1.0);
    }
}
