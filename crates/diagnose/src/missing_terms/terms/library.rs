//! Library of physical terms for a residual source term, one line each.
//!
//! Step sizes come from the physics of such a machine, not from a recording. The oil takes 8 W/K, gas and housing exchange some
//! 20 W/K, the shaft carries a tenth of a newton metre.

use crate::missing_terms::terms::balance::Balance;
use crate::missing_terms::terms::expression::Expression::{self, Number, Of, Value};
use crate::missing_terms::terms::expression::{
    above, below, difference, fourth_powers, power, product, times,
};
use crate::missing_terms::terms::quantity::Quantity::{
    self, Ambient, Bearing, Flow, Oil, P1, P2, P3, P4, PressureRatio, Speed, T1, T2, T2Prime, T3, Tc, Tt,
};
use crate::missing_terms::terms::term::{Role, Term};
use mapper_core::Channel;
use mapper_physics::laws::housing::STEFAN_BOLTZMANN_W_M2K4;

/// Reference for a single temperature in a term, K: near the middle of all, so that level and slope of a law are distinguishable.
pub const REFERENCE_K: f64 = 323.15;
/// Speed scale: 100 krpm, rad/s.
const SPEED_RAD_S: f64 = 10_471.975_511_965_978;
/// Flow scale, kg/s.
const FLOW_KG_S: f64 = 0.06;
/// Pressure scale, Pa.
const PRESSURE_PA: f64 = 1e5;

/// Powers of the speed, and the words that follow "growing with the speed".
const GROWTHS: [(f64, &str); 3] = [(1.0, ""), (2.0, "'s square"), (3.0, "'s cube")];

/// All terms.
pub fn library() -> Vec<Term> {
    let mut all = Vec::new();
    for (balance, metal) in [(Balance::CompressorHousing, Tc), (Balance::TurbineHousing, Tt)] {
        let on = |formula, unit, step, words: &str| alone(balance, formula, unit, step, words);
        all.push(on(Number(1.0), "W", 50.0, "{} to {}"));
        all.push(on(
            below(REFERENCE_K, Of(metal)),
            "W/K",
            1.0,
            "{} for each kelvin that {} is below 50 degC",
        ));
        for other in [Ambient, Oil, T1, T3] {
            all.push(on(
                difference(other, metal),
                "W/K",
                1.0,
                &format!("{{}} from {} to {{}}", other.words()),
            ));
        }
        all.push(on(
            times(STEFAN_BOLTZMANN_W_M2K4, fourth_powers(Ambient, metal)),
            "m2",
            0.05,
            "radiation over {} between {} and the cell",
        ));
        for (exponent, growing) in GROWTHS {
            let words = format!("{{}} at 100 krpm, growing with the speed{growing}, to {{}}");
            all.push(on(power(Speed, SPEED_RAD_S, exponent), "W", 50.0, &words));
        }
        all.push(on(power(Flow, FLOW_KG_S, 1.0), "W", 50.0, "{} at 60 g/s, growing with the flow, to {}"));
    }
    for other in [Tt, T2] {
        all.push(alone(
            Balance::CompressorHousing,
            difference(other, Tc),
            "W/K",
            1.0,
            &format!("{{}} from {} to {{}}", other.words()),
        ));
    }
    all.push(between(
        Balance::CompressorHousing,
        Balance::TurbineHousing,
        |sign| times(sign, difference(Tt, Tc)),
        "W/K",
        1.0,
        "{} from the turbine housing to the compressor housing",
    ));
    all.push(between(
        Balance::CompressorHousing,
        Balance::TurbineHousing,
        |sign| times(sign * STEFAN_BOLTZMANN_W_M2K4, fourth_powers(Tt, Tc)),
        "m2",
        5e-3,
        "radiation over {} from the turbine housing to the compressor housing",
    ));
    let shaft = |formula, unit, step, words: &str| alone(Balance::Shaft, formula, unit, step, words);
    all.push(shaft(Number(-1.0), "N m", 0.01, "a constant torque of {} against the shaft"));
    for (exponent, growing) in &GROWTHS[..2] {
        let words = format!("a torque of {{}} at 100 krpm, growing with the speed{growing}");
        all.push(shaft(power(Speed, SPEED_RAD_S, *exponent), "N m", 0.01, &words));
    }
    all.push(shaft(
        power(Speed, SPEED_RAD_S, -1.0),
        "N m",
        0.01,
        "a torque of {} at 100 krpm, a constant power",
    ));
    all.push(shaft(
        product(power(Speed, SPEED_RAD_S, 1.0), times(0.01, above(Oil, REFERENCE_K))),
        "N m",
        0.03,
        "a torque of {} at 100 krpm for each 100 K of the oil",
    ));
    all.push(shaft(
        times(1.0 / PRESSURE_PA, difference(P3, P4)),
        "N m",
        0.01,
        "a torque of {} for each bar across the turbine",
    ));
    all.push(shaft(
        times(1.0 / PRESSURE_PA, difference(P2, P1)),
        "N m",
        0.01,
        "a torque of {} for each bar across the compressor",
    ));
    let outlet = |formula, unit, step, words: &str| alone(Balance::Outlet, formula, unit, step, words);
    all.push(outlet(Number(-1.0), "kg/s", 1e-3, "a constant loss of {} behind the compressor"));
    all.push(outlet(
        times(-1.0 / PRESSURE_PA, difference(P2, P1)),
        "kg/s",
        1e-3,
        "a leak of {} for each bar behind the compressor",
    ));
    all.push(outlet(
        times(-1.0, Expression::Power(Box::new(times(1.0 / PRESSURE_PA, difference(P2, P1))), 0.5)),
        "kg/s",
        1e-3,
        "a leak of {} at one bar behind the compressor, with its root",
    ));
    all.push(outlet(
        times(-1.0, power(P2, PRESSURE_PA, 1.0)),
        "kg/s",
        1e-3,
        "a choked leak of {} for each bar behind the compressor",
    ));
    for balance in [Balance::GasBefore, Balance::GasAfter, Balance::GasOutlet] {
        let on = |formula, unit, step, words: &str| alone(balance, formula, unit, step, words);
        let gas = |other: Quantity| Expression::Minus(Box::new(Of(other)), Box::new(Value));
        all.push(on(Number(1.0), "W", 50.0, "{} to {}"));
        all.push(on(below(REFERENCE_K, Value), "W/K", 0.5, "{} for each kelvin below 50 degC to {}"));
        for other in [Ambient, Oil, Bearing, Tt, Tc] {
            all.push(on(gas(other), "W/K", 0.5, &format!("{{}} from {} to {{}}", other.words())));
        }
        for (exponent, growing) in &GROWTHS[1..] {
            let words = format!("{{}} at 100 krpm, growing with the speed{growing}, to {{}}");
            all.push(on(power(Speed, SPEED_RAD_S, *exponent), "W", 50.0, &words));
        }
        // Heat to the gas is lost by a housing.
        let seen = match balance {
            Balance::GasBefore => T1,
            Balance::GasAfter => T2Prime,
            _ => T2,
        };
        for (metal, housing) in [(Tc, Balance::CompressorHousing), (Tt, Balance::TurbineHousing)] {
            all.push(Term {
                acts_on: vec![(balance, gas(metal)), (housing, difference(seen, metal))],
                unit: "W/K",
                step: 0.5,
                role: Role::Exchange,
                positive: true,
                words: format!("{{}} from {} to {}", metal.words(), seen.words()),
            });
        }
    }
    for (balance, name) in
        [(Balance::Work, "efficiency"), (Balance::Convection, "h"), (Balance::MapFlow, "the map's flow")]
    {
        let step = balance.plain_size();
        let on = |formula, words: &str| {
            alone(balance, formula, "1", step, &format!("{name} changed by {{}} {words}"))
        };
        all.push(on(Number(1.0), "everywhere"));
        for temperature in [Tc, Tt, T1, Oil] {
            all.push(on(
                times(0.01, above(temperature, REFERENCE_K)),
                &format!("for each 100 K that {} is above 50 degC", temperature.words()),
            ));
        }
        all.push(on(
            Expression::Minus(Box::new(power(Speed, SPEED_RAD_S, 1.0)), Box::new(Number(1.0))),
            "for each 100 krpm above 100 krpm",
        ));
        all.push(on(above(PressureRatio, 1.5), "for each 1 of the pressure ratio above 1.5"));
        if balance != Balance::MapFlow {
            all.push(on(
                Expression::Ln(Box::new(power(Flow, FLOW_KG_S, 1.0))),
                "times the logarithm of the flow over 60 g/s",
            ));
        }
    }
    for channel in [
        Channel::ShaftSpeed,
        Channel::CompressorFlow,
        Channel::P2,
        Channel::T2,
        Channel::Tc,
        Channel::TurbineFlow,
        Channel::T4,
        Channel::Tt,
    ] {
        let balance = Balance::Reading(channel);
        let on = |formula, unit, step, words: &str| alone(balance, formula, unit, step, words);
        all.push(on(Number(1.0), channel.unit(), balance.plain_size(), "{} added to {}"));
        let counted = if channel.unit() == "K" {
            Expression::Minus(Box::new(Value), Box::new(Number(REFERENCE_K)))
        } else {
            Value
        };
        all.push(on(counted, "1", 0.02, "a gain error of {} of {}"));
        if channel.unit() == "K" {
            for other in [Ambient, Tc, Tt, T2] {
                all.push(on(
                    Expression::Minus(Box::new(Of(other)), Box::new(Value)),
                    "1",
                    0.02,
                    &format!("{{}} of the way to {} in {{}}", other.words()),
                ));
            }
        }
        all.push(Term {
            acts_on: vec![(Balance::Lag(channel), Number(1.0))],
            unit: "s",
            step: 3.0,
            role: Role::Other,
            positive: true,
            words: format!("a lag of {{}} of the reading of {channel}"),
        });
    }
    all
}

/// A term in one balance.
fn alone(balance: Balance, formula: Expression, unit: &'static str, step: f64, words: &str) -> Term {
    // The second placeholder is the balance's own.
    let words = match words.match_indices("{}").nth(1) {
        Some((place, _)) => {
            let whose = balance.place_words();
            format!("{}{whose}{}", &words[..place], &words[place + 2..])
        }
        None => words.to_owned(),
    };
    let role = match (&formula, unit) {
        (Number(_), unit) if unit != "1" => Role::Level,
        // Relative to the reference.
        (Expression::Minus(from, _), "W/K") if matches!(**from, Number(_)) => Role::Slope,
        (_, "W/K" | "m2") => Role::Exchange,
        _ => Role::Other,
    };
    // Heat flows from hot to cold.
    let positive = matches!(unit, "W/K" | "m2");
    Term { acts_on: vec![(balance, formula)], unit, step, words, role, positive }
}

/// Heat from one part to another: what the first gains, the second loses.
fn between(
    to: Balance,
    from: Balance,
    formula: impl Fn(f64) -> Expression,
    unit: &'static str,
    step: f64,
    words: &str,
) -> Term {
    Term {
        acts_on: vec![(to, formula(1.0)), (from, formula(-1.0))],
        unit,
        step,
        words: words.to_owned(),
        role: Role::Exchange,
        positive: true,
    }
}
