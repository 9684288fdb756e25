//! All functions that a script may call: one row per function defines its registration and its documentation.

use crate::error::throw;
use crate::request::Refusal;
use crate::session::{ScriptThrow, Session, lock};
use crate::settle::{EndCondition, StepResult};
use mapper_core::{CHANNELS, Channel, IdentifiedPoint, OperatingPoint};
use mapper_yaml::units::Kind;
use rhai::{Array, Dynamic, Engine, FLOAT, INT, ImmutableString};
use std::sync::{Arc, Mutex};

pub(crate) type SharedSession = Arc<Mutex<Session>>;

/// A function or property.
pub struct Entry {
    /// Chapter of the documentation.
    pub group: &'static str,
    /// Call syntax in a script.
    pub signature: &'static str,
    /// Description of one or two sentences.
    pub doc: &'static str,
    register: fn(&mut Engine, &SharedSession),
}

/// A point, as scripts use it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point(OperatingPoint);

/// Default drift of T2 and Tc at which a point counts as settled, K/s: 1 K in a minute.
const SETTLED_RATE_K_S: f64 = 1.0 / 60.0;

/// Standard errors of unknown quantities in scripts. They are finite because rhai compares by relative differences, which infinity
/// makes meaningless. An efficiency lies between 0 and 1.
const SIGMA_ETA_MAX: f64 = 1.0;
const SIGMA_H_MAX_W_M2K: f64 = 1e6;

macro_rules! table {
    ($($group:literal { $($signature:literal, $doc:literal => $register:expr;)+ })+) => {
        /// Every row, in the order of the documentation.
        const TABLE: &[Entry] = &[$($(
            Entry { group: $group, signature: $signature, doc: $doc, register: $register },
        )+)+];
    };
}

/// Every function and property that a script may use, in the order of the documentation.
pub fn functions() -> &'static [Entry] {
    TABLE
}

/// Registers all rows of [`TABLE`], and the text form of points and results.
pub(crate) fn register(engine: &mut Engine, session: &SharedSession) {
    engine.register_type_with_name::<Point>("Point").register_type_with_name::<StepResult>("Result");
    engine.register_fn("==", |a: Point, b: Point| a == b).register_fn("!=", |a: Point, b: Point| a != b);
    for name in ["to_string", "to_debug"] {
        engine.register_fn(name, |point: &mut Point| point.0.to_string());
        engine.register_fn(name, |result: &mut StepResult| describe_result(result));
        engine.register_fn(name, |refusal: &mut Refusal| refusal.message.clone());
    }
    let notes = session.clone();
    engine.on_print(move |text| lock(&notes).note(text));
    let notes = session.clone();
    engine.on_debug(move |text, _, _| lock(&notes).note(text));
    for entry in TABLE {
        (entry.register)(engine, session);
    }
}

table! {
    "Points" {
        "grid()", "All points of the campaign's grid, in its order." => |engine, session| {
            let session = session.clone();
            engine.register_fn("grid", move || to_array(&lock(&session).request.points));
        };
        "point(speed, opening)", "A point, e.g. `point(\"110 krpm\", 0.7)`; it need not be one of the grid." => |engine, _| {
            engine.register_fn("point", |speed: &str, opening: FLOAT| parse_point(speed, opening));
            engine.register_fn("point", |speed: &str, opening: INT| parse_point(speed, opening as FLOAT));
        };
        "p.speed_rpm", "Shaft speed, rpm." =>
            |engine, _| { engine.register_get("speed_rpm", |point: &mut Point| point.0.speed_rpm); };
        "p.opening", "Valve opening relative to the nominal area." =>
            |engine, _| { engine.register_get("opening", |point: &mut Point| point.0.valve_opening_ratio); };
        "midpoint(a, b)", "The point halfway in speed and in opening." => |engine, _| {
            engine.register_fn("midpoint", |a: Point, b: Point| Point(OperatingPoint {
                speed_rpm: 0.5 * (a.0.speed_rpm + b.0.speed_rpm),
                valve_opening_ratio: 0.5 * (a.0.valve_opening_ratio + b.0.valve_opening_ratio),
            }));
        };
        "reachable(p)", "Whether a step may go to `p`: it is within all limits, and the nominal machine can hold it." => |engine, session| {
            let session = session.clone();
            engine.register_fn("reachable", move |point: Point| lock(&session).is_reachable(point.0));
        };
        "order(points)", "The points, ordered by the planner according to the campaign's `order`." => |engine, session| {
            let session = session.clone();
            engine.register_fn("order", move |points: Array| -> Result<Array, ScriptThrow> {
                let points = parse_points(points)?;
                Ok(to_array(&lock(&session).order(&points)?))
            });
        };
    }
    "Steps" {
        "dwell(time)", "Time at each point from now on, jump included; the campaign's `timing.dwell` until then." => |engine, session| {
            let session = session.clone();
            engine.register_fn("dwell", move |time: &str| -> Result<(), ScriptThrow> {
                lock(&session).dwell_s = parse_quantity(Kind::Duration, time)?;
                Ok(())
            });
        };
        "t3(temperature)", "Turbine inlet temperature of the steps that follow; the campaign's until then. The speed does not change: P3 follows from the nominal machine." => |engine, session| {
            let session = session.clone();
            engine.register_fn("t3", move |temperature: &str| -> Result<(), ScriptThrow> {
                lock(&session).set_t3(parse_quantity(Kind::Temperature, temperature)?)
            });
        };
        "oil(temperature)", "Oil inlet temperature of the steps that follow; the campaign's until then." => |engine, session| {
            let session = session.clone();
            engine.register_fn("oil", move |temperature: &str| -> Result<(), ScriptThrow> {
                lock(&session).set_oil_temperature(parse_quantity(Kind::Temperature, temperature)?)
            });
        };
        "jump(p)", "Goes to `p`, stays for the dwell, and returns the step's result. A point that was visited before counts as a repeat." => |engine, session| {
            let session = session.clone();
            engine.register_fn("jump", move |point: Point| {
                let mut session = lock(&session);
                let dwell_s = session.dwell_s;
                session.step(point.0, dwell_s, EndCondition::Dwell)
            });
        };
        "jump(p, time)", "Like `jump(p)`, with another dwell." => |engine, session| {
            let session = session.clone();
            engine.register_fn("jump", move |point: Point, time: &str| {
                let dwell_s = parse_quantity(Kind::Duration, time)?;
                lock(&session).step(point.0, dwell_s, EndCondition::Dwell)
            });
        };
        "settle(p, longest)", "Goes to `p` and holds until it has settled, at most `longest`: over the last 30 s, T2 and Tc drift by less than 1 K in a minute, and speed, flow and pressure ratio stay within the campaign's `stabilisation`." => |engine, session| {
            let session = session.clone();
            engine.register_fn("settle", move |point: Point, longest: &str| {
                let max_s = parse_quantity(Kind::Duration, longest)?;
                lock(&session).settle(point.0, max_s, SETTLED_RATE_K_S)
            });
        };
        "settle(p, longest, rate)", "Like `settle(p, longest)`, with another drift limit, e.g. `\"0.005 K/s\"`." => |engine, session| {
            let session = session.clone();
            engine.register_fn("settle", move |point: Point, longest: &str, rate: &str| {
                let (max_s, rate_k_s) = (parse_quantity(Kind::Duration, longest)?, parse_quantity(Kind::TemperatureRate, rate)?);
                lock(&session).settle(point.0, max_s, rate_k_s)
            });
        };
        "hold(time)", "Waits at the point of the last step, without a jump, and returns the result of this time." => |engine, session| {
            let session = session.clone();
            engine.register_fn("hold", move |time: &str| {
                let duration_s = parse_quantity(Kind::Duration, time)?;
                lock(&session).hold(duration_s)
            });
        };
        "rest(time)", "Air off before the next step: the machine stands still for this time, and the next step starts it. What its sensors then read differently counts as it does after a soak." => |engine, session| {
            let session = session.clone();
            engine.register_fn("rest", move |time: &str| {
                let duration_s = parse_quantity(Kind::Duration, time)?;
                lock(&session).rest(duration_s, false)
            });
        };
        "zero(time)", "Like `rest(time)`, with the oil at the temperature of the inlet air: an isothermal zero, whose offsets are subtracted from the whole run. The last zero of a run counts." => |engine, session| {
            let session = session.clone();
            engine.register_fn("zero", move |time: &str| {
                let duration_s = parse_quantity(Kind::Duration, time)?;
                lock(&session).rest(duration_s, true)
            });
        };
        "repeat(n)", "Repeats step `n` by the same jump, so that the two can be compared: goes to the start of the jump if necessary, and jumps again. Returns the result of the jump." => |engine, session| {
            let session = session.clone();
            engine.register_fn("repeat", move |number: INT| lock(&session).repeat(number));
        };
    }
    "Results" {
        "result(n)", "The result of step `n`, counted from 1." => |engine, session| {
            let session = session.clone();
            engine.register_fn("result", move |number: INT| lock(&session).result(number));
        };
        "results()", "The results of all steps so far." => |engine, session| {
            let session = session.clone();
            engine.register_fn("results", move || -> Array {
                lock(&session).results.iter().cloned().map(Dynamic::from).collect()
            });
        };
        "r.step", "Number of the step, from 1." =>
            |engine, _| { engine.register_get("step", |result: &mut StepResult| result.number as INT); };
        "r.point", "Target of the step." =>
            |engine, _| { engine.register_get("point", |result: &mut StepResult| Point(result.target)); };
        "r.verdict", "`\"good\"`, `\"doubtful\"` or `\"unusable\"`." =>
            |engine, _| { engine.register_get("verdict", |result: &mut StepResult| ImmutableString::from(result.verdict())); };
        "r.warnings", "Codes of the reasons for the verdict, e.g. `small_gradient`." =>
            |engine, _| { engine.register_get("warnings", |result: &mut StepResult| warning_codes(result)); };
        "r.has_eta", "Whether the step has an efficiency. The first step of a run has none, because it has no jump." =>
            |engine, _| { engine.register_get("has_eta", |result: &mut StepResult| result.eta().is_some()); };
        "r.eta", "Efficiency, fraction." =>
            |engine, _| { engine.register_get("eta", |result: &mut StepResult| number_or_unit(result.eta())); };
        "r.sigma_eta", "Its standard error, fraction; 1 without an efficiency, so that `r.sigma_eta > 0.005` is true." =>
            |engine, _| { engine.register_get("sigma_eta", |result: &mut StepResult| result.sigma_eta().min(SIGMA_ETA_MAX)); };
        "r.h_w_m2k", "Heat-transfer coefficient, W/(m2 K)." =>
            |engine, _| { engine.register_get("h_w_m2k", |result: &mut StepResult| number_or_unit(result.h_w_m2k())); };
        "r.sigma_h_w_m2k", "Its standard error, W/(m2 K); 1e6 without a coefficient." =>
            |engine, _| { engine.register_get("sigma_h_w_m2k", |result: &mut StepResult| result.sigma_h_w_m2k().min(SIGMA_H_MAX_W_M2K)); };
        "r.speed_rpm", "Measured shaft speed at the end of the step, rpm." =>
            |engine, _| { register_measurement(engine, "speed_rpm", |point| Some(point.speed_rpm)); };
        "r.flow_kg_s", "Compressor mass flow at the end of the step, kg/s." =>
            |engine, _| { register_measurement(engine, "flow_kg_s", |point| Some(point.flow_kg_s)); };
        "r.pressure_ratio", "Total pressure ratio at the end of the step." =>
            |engine, _| { register_measurement(engine, "pressure_ratio", |point| Some(point.pressure_ratio)); };
        "r.dt2_k", "Change of T2 over the window, K." =>
            |engine, _| { register_measurement(engine, "dt2_k", |point| point.dt2_k); };
        "r.dtc_k", "Change of the housing temperature over the window, K." =>
            |engine, _| { register_measurement(engine, "dtc_k", |point| point.dtc_k); };
        "r.mean(channel)", "Mean reading of a channel over the second half of the step, e.g. `r.mean(\"P2\")`, in its SI unit or rpm; `()` if it was not recorded." => |engine, _| {
            engine.register_fn("mean", |result: &mut StepResult, channel: &str| reading(result, channel, |(mean, _)| mean));
        };
        "r.variance(channel)", "Variance of the same readings, in the square of this unit. Near surge that of pressures and flow grows." => |engine, _| {
            engine.register_fn("variance", |result: &mut StepResult, channel: &str| reading(result, channel, |(_, variance)| variance));
        };
        "r.duration_s", "Duration of the step, s." =>
            |engine, _| { engine.register_get("duration_s", |result: &mut StepResult| result.end_s - result.start_s); };
    }
    "Other" {
        "elapsed_s()", "Time since the start of the run, warm-up included, s." => |engine, session| {
            let session = session.clone();
            engine.register_fn("elapsed_s", move || lock(&session).now_s());
        };
        "note(text)", "Puts a note into the recording and the report. `print(..)` does the same." => |engine, session| {
            let session = session.clone();
            engine.register_fn("note", move |text: &str| lock(&session).note(text));
        };
    }
}

/// Registers a property of a result's point.
fn register_measurement(engine: &mut Engine, name: &'static str, value: fn(&IdentifiedPoint) -> Option<f64>) {
    engine.register_get(name, move |result: &mut StepResult| {
        number_or_unit(result.identified.as_ref().and_then(value).filter(|value| value.is_finite()))
    });
}

fn reading(result: &StepResult, channel: &str, of: fn((f64, f64)) -> f64) -> Result<Dynamic, ScriptThrow> {
    let unknown = |_| {
        let names = CHANNELS.iter().map(|row| row.channel.to_string()).collect::<Vec<_>>().join(", ");
        throw(format!("unknown channel `{channel}`"), &format!("one of {names}"))
    };
    let channel: Channel = channel.parse().map_err(unknown)?;
    Ok(number_or_unit(result.readings.get(&channel).copied().map(of)))
}

fn number_or_unit(value: Option<f64>) -> Dynamic {
    value.map_or(Dynamic::UNIT, Dynamic::from_float)
}

fn to_array(points: &[OperatingPoint]) -> Array {
    points.iter().map(|point| Dynamic::from(Point(*point))).collect()
}

fn parse_quantity(kind: Kind, text: &str) -> Result<f64, ScriptThrow> {
    mapper_yaml::units::parse(kind, text).map_err(|error| throw(error.to_string(), &error.remedy(kind)))
}

fn parse_point(speed: &str, opening: FLOAT) -> Result<Point, ScriptThrow> {
    let speed_rpm = parse_quantity(Kind::Speed, speed)?;
    Ok(Point(OperatingPoint { speed_rpm, valve_opening_ratio: opening }))
}

fn parse_points(array: Array) -> Result<Vec<OperatingPoint>, ScriptThrow> {
    let parse = |item: Dynamic| {
        let kind = item.type_name();
        item.try_cast::<Point>().map(|point| point.0).ok_or_else(|| {
            throw(
                format!("order() takes an array of points; this array contains a {kind}"),
                "e.g. order(grid())",
            )
        })
    };
    array.into_iter().map(parse).collect()
}

fn warning_codes(result: &StepResult) -> Array {
    let all = result.identified.iter().flat_map(|point| &point.warnings);
    all.map(|warning| Dynamic::from(ImmutableString::from(warning.code()))).collect()
}

fn describe_result(result: &StepResult) -> String {
    match result.eta() {
        Some(eta) => format!(
            "step {} at {}: eta {:.2} +/- {:.2} % ({})",
            result.number,
            result.target,
            100.0 * eta,
            100.0 * result.sigma_eta(),
            result.verdict()
        ),
        None => format!("step {} at {}: no efficiency", result.number, result.target),
    }
}
