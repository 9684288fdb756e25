//! Figure 2: the transient after a rapid change of the turbine inlet pressure, and section 3's estimates about it.

use crate::reproduction::lab::{Run, Truth, WINDOW, extremes, fixed, range, truth_in_window};
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Axis, Figure, Line, Panel, palette};
use mapper_core::SettleBands;
use mapper_physics::gas::air::{heat_capacity_j_kgk, ln_conductivity_ratio, viscosity_pa_s};

/// The jump that is drawn: as in the paper's figure, to a higher speed.
const DRAWN: (f64, f64) = (110e3, 1.0);
/// Change of the gas temperature in the window, K, and the range of section 3, K.
const CHANGE_K: f64 = 26.0;
const RANGE_K: (f64, f64) = (293.15, 473.15);
/// Share of a change that a first-order lag makes in one time constant.
const ONE_TIME_CONSTANT: f64 = 0.632;
/// Time that stabilisation typically needs, s. Source: section 5.1.
const STABLE_S: f64 = 10.0;

/// Change of a property of air over [`CHANGE_K`], %, smallest and largest over [`RANGE_K`].
fn change_percent(ln_property: impl Fn(f64) -> f64) -> Option<(f64, f64)> {
    const STEPS: u32 = 100;
    let (low_k, high_k) = (RANGE_K.0, RANGE_K.1 - CHANGE_K);
    extremes((0..=STEPS).map(|step| {
        let t_k = low_k + (high_k - low_k) * f64::from(step) / f64::from(STEPS);
        Some(100.0 * (ln_property(t_k + CHANGE_K) - ln_property(t_k)).exp_m1())
    }))
}

/// Whether a range of changes lies within the limits of the paper, in size; `Partly` if only a part of it does.
fn within(changes: Option<(f64, f64)>, limits: (f64, f64)) -> Verdict {
    let Some((low, high)) = changes.map(|(a, b)| (a.abs().min(b.abs()), a.abs().max(b.abs()))) else {
        return Verdict::Differs;
    };
    // The paper prints whole percents.
    let (from, to) = (limits.0 - 0.5, limits.1 + 0.5);
    Verdict::of(low >= from && high <= to, low <= to && high >= from)
}

type Value = fn(&Truth) -> f64;

/// Seconds until a quantity has made [`ONE_TIME_CONSTANT`] of its change.
fn time_constant_s(run: &Run, value: fn(&Truth) -> f64) -> f64 {
    let (first, last) = (run.truth.first().map_or(f64::NAN, value), run.truth.last().map_or(f64::NAN, value));
    let made = |truth: &&Truth| (value(truth) - first) / (last - first) >= ONE_TIME_CONSTANT;
    run.truth.iter().find(made).map_or(f64::NAN, |truth| truth.t_s)
}

/// Seconds after which flow, pressure ratio and speed stay within the paper's variations over 100 s; `None` if they do not within the run.
fn stable_s(run: &Run) -> Option<f64> {
    let bands = SettleBands::PAPER;
    let signals: [(Value, f64); 3] = [
        (|t| t.flow_kg_s, bands.flow_ratio),
        (|t| t.pressure_ratio, bands.pressure_ratio_ratio),
        (|t| t.speed_rpm, bands.speed_ratio),
    ];
    let mut start_s = 0.0f64;
    for (value, band) in signals {
        let last = value(run.truth.last()?);
        let (mut low, mut high) = (last, last);
        let leaves = run.truth.iter().rev().find(|truth| {
            (low, high) = (low.min(value(truth)), high.max(value(truth)));
            high - low > band * last
        });
        start_s = start_s.max(leaves.map_or(0.0, |truth| truth.t_s));
    }
    Some(start_s)
}

fn properties() -> Vec<Statement> {
    let density = change_percent(|t_k| -t_k.ln());
    let conductivity = change_percent(ln_conductivity_ratio);
    let heat_capacity = change_percent(|t_k| heat_capacity_j_kgk(t_k).ln());
    let viscosity = change_percent(|t_k| viscosity_pa_s(t_k).ln());
    let reynolds = change_percent(|t_k| -viscosity_pa_s(t_k).ln());
    let ln_prandtl =
        |t_k: f64| heat_capacity_j_kgk(t_k).ln() + viscosity_pa_s(t_k).ln() - ln_conductivity_ratio(t_k);
    let prandtl = change_percent(ln_prandtl);
    let [re, pr] = [within(reynolds, (4.0, 6.0)), within(prandtl, (0.0, 0.0))];
    // The skin keeps its temperature.
    let h = |exponent: f64| {
        change_percent(|t_k| {
            ln_conductivity_ratio(t_k) + (0.14 - exponent) * viscosity_pa_s(t_k).ln() + ln_prandtl(t_k) / 3.0
        })
    };
    let (appendix_a, eq_9) = (h(1.13), h(0.8));
    let is_small = |percent: Option<(f64, f64)>| percent.is_some_and(|(a, b)| a.abs().max(b.abs()) < 1.0);
    vec![
        Statement::new(
            "A change of 26 K at 20 to 200 degC changes the density of air by 4 to 6 % (section 3).",
            format!("{} % by the ideal gas law.", range(density, 1)),
            within(density, (4.0, 6.0)),
        ),
        Statement::new(
            "k_f, c_p and mu change by 4 to 6 %, 3 to 5 % and less than 0.5 %.",
            format!(
                "k_f {} %, c_p {} %, mu {} %: the paper exchanges c_p and mu.",
                range(conductivity, 1),
                range(heat_capacity, 1),
                range(viscosity, 1)
            ),
            Verdict::Partly,
        ),
        Statement::new(
            "Re changes by 4 to 6 % and Pr by less than 0.3 %.",
            format!("Re {} % at constant flow, Pr {} %.", range(reynolds, 1), range(prandtl, 1)),
            Verdict::of([re, pr] == [Verdict::Holds; 2], re != Verdict::Differs),
        ),
        Statement::new(
            "Therefore h changes by less than 1 % and may be taken as constant.",
            format!(
                "{} % with the exponent 1.13 of Appendix A, {} % with the 0.8 of eq. 9.",
                range(appendix_a, 1),
                range(eq_9, 1)
            ),
            Verdict::of(is_small(appendix_a) && is_small(eq_9), is_small(appendix_a)),
        ),
    ]
}

pub(crate) fn figure(runs: &[Run]) -> Result<FigureResult, ReproduceError> {
    let is_drawn = |run: &&Run| (run.jump.to_rpm, run.jump.opening) == DRAWN;
    let drawn = runs.iter().find(is_drawn).ok_or(ReproduceError::NoStep)?;
    let (first, last) = drawn.truth.first().zip(drawn.truth.last()).ok_or(ReproduceError::NoStep)?;
    let change = |value: fn(&Truth) -> f64| (value(first), value(last));
    let rises = |(from, to): (f64, f64)| to > from;
    let [speed, flow, pressure_ratio, t2, tc] = [
        change(|t| t.speed_rpm / 1e3),
        change(|t| 1e3 * t.flow_kg_s),
        change(|t| t.pressure_ratio),
        change(|t| t.t2_k - 273.15),
        change(|t| t.tc_k - 273.15),
    ];
    let pair =
        |(from, to): (f64, f64), decimals| format!("{} to {}", fixed(from, decimals), fixed(to, decimals));
    let [speed_s, t2_s, tc_s] = [
        time_constant_s(drawn, |t| t.speed_rpm),
        time_constant_s(drawn, |t| t.t2_k),
        time_constant_s(drawn, |t| t.tc_k),
    ];
    let stable: Vec<f64> = runs.iter().filter_map(stable_s).collect();
    let in_time = stable.iter().filter(|s| **s <= STABLE_S).count();
    let gas = extremes(runs.iter().flat_map(|run| &run.truth).map(|t| Some(t.t2_k - 273.15)));
    let mut statements = vec![
        Statement::new(
            "A rapid rise of P3 at constant turbine inlet temperature and valve raises speed, flow and pressure ratio, and with them T2 and Tc.",
            format!(
                "Speed {} krpm, flow {} g/s, pressure ratio {}, T2 {} degC, Tc {} degC.",
                pair(speed, 0),
                pair(flow, 1),
                pair(pressure_ratio, 2),
                pair(t2, 1),
                pair(tc, 1)
            ),
            Verdict::holds_if([speed, flow, pressure_ratio, t2, tc].into_iter().all(rises)),
        ),
        Statement::new(
            "The temperature rise of the compression follows the shaft; that of the heat is much slower, because of the housing.",
            format!(
                "63 % of the change after {} s (speed), {} s (T2), {} s (Tc).",
                fixed(speed_s, 1),
                fixed(t2_s, 1),
                fixed(tc_s, 1)
            ),
            Verdict::holds_if(tc_s > 5.0 * t2_s.max(speed_s)),
        ),
        Statement::new(
            "Stabilisation of speed, flow and pressure ratio typically needs 10 s (section 5.1).",
            format!(
                "To the paper's variations (0.8, 2 and 1.5 % in flow, pressure ratio and speed) within 10 s at {in_time} of {} jumps; {} s over all.",
                runs.len(),
                range(extremes(stable.iter().map(|s| Some(*s))), 0).replace('+', "")
            ),
            if 2 * in_time >= runs.len() { Verdict::Holds } else { Verdict::Partly },
        ),
        Statement::new(
            "The outlet temperature lies between about 20 and 200 degC.",
            format!("{} degC over the jumps of table 1.", range(gas, 0).replace('+', "")),
            Verdict::holds_if(gas.is_some_and(|(low, high)| low > 15.0 && high < 205.0)),
        ),
    ];
    statements.extend(properties());
    let mut table =
        Table::new(["time, s", "speed, krpm", "flow, g/s", "pressure ratio", "T2, degC", "Tc, degC"]);
    for t_s in [0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 80.0, 110.0] {
        let Some(truth) = drawn.truth.iter().find(|truth| truth.t_s >= t_s - 1e-6) else { continue };
        table.row([
            fixed(t_s, 1),
            fixed(truth.speed_rpm / 1e3, 2),
            fixed(1e3 * truth.flow_kg_s, 2),
            fixed(truth.pressure_ratio, 3),
            fixed(truth.t2_k - 273.15, 2),
            fixed(truth.tc_k - 273.15, 2),
        ]);
    }
    Ok(FigureResult {
        number: "2".to_owned(),
        title: "the thermal transient after a jump".to_owned(),
        method: format!(
            "A jump of table 1, {} at opening {:.1}, without noise; section 3's estimates by the air of the model.",
            drawn.jump.name(),
            drawn.jump.opening
        ),
        statements,
        table,
        svg: picture(drawn),
    })
}

fn picture(run: &Run) -> String {
    let time = || Axis::new("time after the jump, s");
    let temperature = || Axis::new("temperature, degC");
    let lines = |mut panel: Panel, truths: &[Truth]| {
        let of = |value: fn(&Truth) -> f64| truths.iter().map(|t| (t.t_s, value(t) - 273.15)).collect();
        panel.add(Line::new(of(|t| t.t2_k), palette::ORANGE).label("T2, gas at the outlet"));
        panel.add(Line::new(of(|t| t.tc_k), palette::BLUE).label("Tc, compressor housing"));
        panel
    };
    let whole = Panel::new(time(), temperature()).title("(a) the transient");
    let zoom = Panel::new(time(), temperature()).title("(b) the window of the identification");
    Figure::new("Figure 2: temperatures after a jump of the turbine inlet pressure")
        .subtitle(format!("{} at opening {:.1}", run.jump.name(), run.jump.opening))
        .panel(lines(whole, &run.truth))
        .panel(lines(zoom, truth_in_window(run, &WINDOW)))
        .to_svg()
}
