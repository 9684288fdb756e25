//! What to do next: the jump that separates the remaining candidates best, or the sensor that would.

use crate::fit::Fit;
use crate::report::{JumpPoint, Next};
use crate::study::Study;
use crate::whiten::{Linearised, rows_of_step};
use mapper_physics::effect::Submodel;

/// A further jump of which one learns less than this, in squared sigmas, is not worth its minutes.
const LEAST_DISCRIMINATION: f64 = 1.0;

/// The jump of the campaign that tells `first` from `second` best for each minute. `odds` is the present logarithm of
/// the odds between them.
///
/// Both predict what they would for a repeat of each recorded jump; their difference, in sigmas of the noise, is what
/// a repeat would show. Where no jump shows enough, the sensor beside the part in which the first sits is named.
pub fn next(study: &Study, linearised: &Linearised, first: &Fit, second: &Fit, odds: f64) -> Option<Next> {
    let mut difference: Vec<f64> =
        first.prediction.values.iter().zip(&second.prediction.values).map(|(a, b)| a - b).collect();
    linearised.whiten(study, &mut difference);
    let points = study.points(&first.hypothesis).ok()?;
    let point = |step: usize| JumpPoint {
        speed_rpm: points[step].speed_rpm,
        valve: study.steps[step].marker.valve_opening_ratio,
    };
    let best = (1..study.steps.len())
        .map(|step| {
            let squares: f64 = difference[rows_of_step(study, step)].iter().map(|d| d * d).sum();
            let marker = &study.steps[step].marker;
            (step, squares, ((marker.end_s - marker.start_s) / 60.0).max(0.1))
        })
        .max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
    let (step, squares, minutes) = best;
    if squares < LEAST_DISCRIMINATION {
        let (effect, _) = first.hypothesis.effects.first().or(second.hypothesis.effects.first())?;
        let part = study.effects[*effect].info().submodel;
        let reason = format!(
            "no jump of this campaign shows the two first candidates more than {:.1} sigma apart",
            squares.sqrt()
        );
        return Some(Next::Sensor { sensor: sensor_for(part).to_owned(), reason });
    }
    // The logarithm of the odds grows by half the squared distance, if the first is right.
    let expected_probability = 1.0 / (1.0 + (-(odds + 0.5 * squares)).exp());
    Some(Next::Jump { from: point(step - 1), to: point(step), expected_probability, minutes })
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
