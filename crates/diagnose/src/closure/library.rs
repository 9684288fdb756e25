//! Library of physical terms for a residual source term, one line each.
//!
//! Step sizes come from the physics of such a machine, not from a recording. The oil takes 8 W/K, gas and housing exchange some
//! 20 W/K, the shaft carries a tenth of a newton metre.

use crate::closure::expression::Expression::{Number, Of, Value};
use crate::closure::expression::Quantity::{
    Ambient, Bearing, Flow, Oil, P1, P2, P3, P4, PressureRatio, Speed, T1, T2, T2Prime, T3, Tc, Tt,
};
use crate::closure::expression::{
    Expression, Quantity, above, below, difference, fourth_powers, minus, power, product, times,
};
use crate::closure::term::{
    Balance, PLAIN_FLOW_KG_S, PLAIN_HEAT_W, PLAIN_LAG_S, PLAIN_TORQUE_NM, Role, Term,
};
use mapper_core::Channel;
use mapper_physics::laws::housing::STEFAN_BOLTZMANN_W_M2K4;

/// Reference for a single temperature in a term, K. Bound: near the middle of all (290 to 370 K), so that level and slope of a closure term are
/// distinguishable; another one gives the same sum.
pub(crate) const REFERENCE_K: f64 = 323.15;
/// Speed scale: 100 krpm, rad/s. Source: a definition, for the words of a term.
const SPEED_RAD_S: f64 = 10_471.975_511_965_978;
/// Flow scale, kg/s. Source: a definition, for the words of a term.
const FLOW_KG_S: f64 = 0.06;
/// Pressure scale, Pa: one bar. Source: a definition, for the words of a term.
const PRESSURE_PA: f64 = 1e5;
/// For each 100 K. Source: a definition, for the words of a term.
const PER_100_K: f64 = 1.0 / 100.0;
/// Pressure ratio to which a term is relative. Source: a definition, near the middle of a map.
const REFERENCE_PRESSURE_RATIO: f64 = 1.5;
/// Step of an exchange between gas and part, W/K. Bound: a fortieth of what gas and housing exchange.
const GAS_EXCHANGE_W_K: f64 = 0.5;
/// Step of a radiating area between housing and cell, m2. Bound: the surface of a housing of 0.1 m.
const CELL_AREA_M2: f64 = 0.05;
/// Step of a radiating area between the housings, m2. Bound: their facing surfaces, a tenth of the above.
const FACING_AREA_M2: f64 = 5e-3;
/// Step of a torque for each 100 K of the oil, N m. Bound: at 100 krpm friction of the bearings takes some hundredths of a newton metre.
const OIL_TORQUE_NM: f64 = 0.03;
/// Step of a gain error, and of the share of the way to another temperature. Bound: several times the error of such a sensor.
const GAIN_RATIO: f64 = 0.02;

/// Powers of the speed, and the words that follow "growing with the". Source: friction of a film grows with the first, windage with the third.
const GROWTHS: [(f64, &str); 3] = [(1.0, "speed"), (2.0, "square of the speed"), (3.0, "cube of the speed")];

pub(crate) fn library() -> Vec<Term> {
    let mut all = Vec::new();
    add_housings(&mut all);
    add_shaft(&mut all);
    add_outlet(&mut all);
    add_gas(&mut all);
    add_relative(&mut all);
    add_sensors(&mut all);
    all
}

fn add_housings(all: &mut Vec<Term>) {
    for (balance, metal) in [(Balance::CompressorHousing, Tc), (Balance::TurbineHousing, Tt)] {
        let mut add = |formula, unit, step, words: &str| all.push(term(balance, formula, unit, step, words));
        add(Number(1.0), "W", PLAIN_HEAT_W, "{} to <place>");
        let slope = below(REFERENCE_K, Of(metal));
        add(slope, "W/K", 1.0, "{} for each kelvin that <place> is below 50 degC");
        for other in [Ambient, Oil, T1, T3] {
            add(difference(other, metal), "W/K", 1.0, &format!("{{}} from {} to <place>", other.words()));
        }
        let radiation = times(STEFAN_BOLTZMANN_W_M2K4, fourth_powers(Ambient, metal));
        add(radiation, "m2", CELL_AREA_M2, "radiation over {} between <place> and the cell");
        for (exponent, growing) in GROWTHS {
            let words = format!("{{}} at 100 krpm, growing with the {growing}, to <place>");
            add(power(Speed, SPEED_RAD_S, exponent), "W", PLAIN_HEAT_W, &words);
        }
        add(
            power(Flow, FLOW_KG_S, 1.0),
            "W",
            PLAIN_HEAT_W,
            "{} at 60 g/s, growing with the flow, to <place>",
        );
    }
    for other in [Tt, T2] {
        let words = format!("{{}} from {} to <place>", other.words());
        all.push(term(Balance::CompressorHousing, difference(other, Tc), "W/K", 1.0, &words));
    }
    // The compressor housing gains the heat that the turbine housing loses.
    let mut add_exchange = |formula: &dyn Fn(f64) -> Expression, unit, step, words: &str| {
        let mut exchange = term(Balance::CompressorHousing, formula(1.0), unit, step, words);
        exchange.acts_on.push((Balance::TurbineHousing, formula(-1.0)));
        all.push(exchange);
    };
    let conduction = |sign| times(sign, difference(Tt, Tc));
    add_exchange(&conduction, "W/K", 1.0, "{} from the turbine housing to <place>");
    let radiation = |sign| times(sign * STEFAN_BOLTZMANN_W_M2K4, fourth_powers(Tt, Tc));
    add_exchange(&radiation, "m2", FACING_AREA_M2, "radiation over {} from the turbine housing to <place>");
}

fn add_shaft(all: &mut Vec<Term>) {
    let speed = |exponent| power(Speed, SPEED_RAD_S, exponent);
    let oil = product(speed(1.0), times(PER_100_K, above(Oil, REFERENCE_K)));
    for (formula, step, words) in [
        (Number(-1.0), PLAIN_TORQUE_NM, "a constant torque of {} against the shaft"),
        (speed(1.0), PLAIN_TORQUE_NM, "a torque of {} at 100 krpm, growing with the speed"),
        (speed(2.0), PLAIN_TORQUE_NM, "a torque of {} at 100 krpm, growing with the square of the speed"),
        (speed(-1.0), PLAIN_TORQUE_NM, "a torque of {} at 100 krpm, a constant power"),
        (oil, OIL_TORQUE_NM, "a torque of {} at 100 krpm for each 100 K that the oil is above 50 degC"),
        (per_bar(1.0, P3, P4), PLAIN_TORQUE_NM, "a torque of {} for each bar across the turbine"),
        (per_bar(1.0, P2, P1), PLAIN_TORQUE_NM, "a torque of {} for each bar across the compressor"),
    ] {
        all.push(term(Balance::Shaft, formula, "N m", step, words));
    }
}

fn add_outlet(all: &mut Vec<Term>) {
    let root = Expression::Power(Box::new(per_bar(1.0, P2, P1)), 0.5);
    let choked = times(-1.0, power(P2, PRESSURE_PA, 1.0));
    for (formula, words) in [
        (Number(-1.0), "a constant leak of {} after the compressor"),
        (per_bar(-1.0, P2, P1), "a leak of {} after the compressor for each bar of P2 - P1"),
        (
            times(-1.0, root),
            "a leak of {} after the compressor at P2 - P1 of one bar, growing with the square root of P2 - P1",
        ),
        (choked, "a choked leak of {} after the compressor for each bar of P2"),
    ] {
        all.push(term(Balance::Outlet, formula, "kg/s", PLAIN_FLOW_KG_S, words));
    }
}

fn add_gas(all: &mut Vec<Term>) {
    for (balance, gas) in [(Balance::GasBefore, T1), (Balance::GasAfter, T2Prime), (Balance::GasOutlet, T2)] {
        let mut add = |formula, unit, step, words: &str| all.push(term(balance, formula, unit, step, words));
        add(Number(1.0), "W", PLAIN_HEAT_W, "{} to <place>");
        add(
            below(REFERENCE_K, Value),
            "W/K",
            GAS_EXCHANGE_W_K,
            "{} for each kelvin below 50 degC to <place>",
        );
        for other in [Ambient, Oil, Bearing, Tt, Tc] {
            let words = format!("{{}} from {} to <place>", other.words());
            add(minus(Of(other), Value), "W/K", GAS_EXCHANGE_W_K, &words);
        }
        for (exponent, growing) in &GROWTHS[1..] {
            let words = format!("{{}} at 100 krpm, growing with the {growing}, to <place>");
            add(power(Speed, SPEED_RAD_S, *exponent), "W", PLAIN_HEAT_W, &words);
        }
        // A housing loses the heat that the gas gains.
        for (metal, housing) in [(Tc, Balance::CompressorHousing), (Tt, Balance::TurbineHousing)] {
            let words = format!("{{}} from {} to {}", metal.words(), gas.words());
            let mut exchange = term(balance, minus(Of(metal), Value), "W/K", GAS_EXCHANGE_W_K, &words);
            exchange.acts_on.push((housing, difference(gas, metal)));
            all.push(exchange);
        }
    }
}

fn add_relative(all: &mut Vec<Term>) {
    for balance in [Balance::Work, Balance::Convection, Balance::MapFlow] {
        let mut add = |formula, words: &str| {
            let words = format!("<place> changed by {{}} {words}");
            all.push(term(balance, formula, "1", balance.properties().plain_size, &words));
        };
        add(Number(1.0), "everywhere");
        for temperature in [Tc, Tt, T1, Oil] {
            let words = format!("for each 100 K that {} is above 50 degC", temperature.words());
            add(times(PER_100_K, above(temperature, REFERENCE_K)), &words);
        }
        let speed = minus(power(Speed, SPEED_RAD_S, 1.0), Number(1.0));
        add(speed, "for each 100 krpm above 100 krpm");
        add(above(PressureRatio, REFERENCE_PRESSURE_RATIO), "for each 1 of the pressure ratio above 1.5");
        if balance != Balance::MapFlow {
            let flow = Expression::Ln(Box::new(power(Flow, FLOW_KG_S, 1.0)));
            add(flow, "times the logarithm of the flow over 60 g/s");
        }
    }
}

fn add_sensors(all: &mut Vec<Term>) {
    use Channel::{CompressorFlow, P2 as P2Sensor, ShaftSpeed, T2 as T2Sensor, T4, TurbineFlow};
    for channel in [ShaftSpeed, CompressorFlow, P2Sensor, T2Sensor, Channel::Tc, TurbineFlow, T4, Channel::Tt]
    {
        let is_temperature = channel.unit() == "K";
        let balance = Balance::Reading(channel);
        let mut add = |formula, unit, step, words: &str| all.push(term(balance, formula, unit, step, words));
        add(Number(1.0), channel.unit(), balance.properties().plain_size, "{} added to <place>");
        let gain = if is_temperature { minus(Value, Number(REFERENCE_K)) } else { Value };
        add(gain, "1", GAIN_RATIO, "a gain error of {} of <place>");
        for other in [Ambient, Tc, Tt, T2].into_iter().filter(|_| is_temperature) {
            let words = format!("{{}} of the way to {} in <place>", other.words());
            add(minus(Of(other), Value), "1", GAIN_RATIO, &words);
        }
        let words = format!("a lag of {{}} of the reading of {channel}");
        let lag = term(Balance::Lag(channel), Number(1.0), "s", PLAIN_LAG_S, &words);
        all.push(Term { role: Role::Other, positive: true, ..lag });
    }
}

/// Pressure difference in bar, times a factor.
fn per_bar(factor: f64, a: Quantity, b: Quantity) -> Expression {
    times(factor / PRESSURE_PA, difference(a, b))
}

/// A term in one balance; `<place>` in the words stands for the place on which the balance acts.
fn term(balance: Balance, formula: Expression, unit: &'static str, step: f64, words: &str) -> Term {
    let role = match (&formula, unit) {
        (Number(_), unit) if unit != "1" => Role::Level,
        // Relative to the reference.
        (Expression::Minus(from, _), "W/K") if matches!(**from, Number(_)) => Role::Slope,
        (_, "W/K" | "m2") => Role::Exchange,
        _ => Role::Other,
    };
    // Heat flows from hot to cold.
    let positive = matches!(unit, "W/K" | "m2");
    let words = words.replace("<place>", &balance.properties().place_words);
    Term { acts_on: vec![(balance, formula)], unit, step, words, role, positive }
}
