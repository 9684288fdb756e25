//! Figure 12: error against the size of the transient on a noisy rig; figure 13: points visited along speed lines and by jumps.

use crate::reproduction::lab::{
    self, Jump, Outcome, PROBE_M, RUN_S, Run, dynamic_config, fixed, identify_recording, paper_machine, rms,
    run_lagged, settled_at,
};
use crate::reproduction::picture::target_speeds_rpm;
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Axis, Figure, Line, Marker, Panel, Rule, RuleAt, Scatter, palette};
use mapper_core::{Channel, Recording, Verdict as PointVerdict, Warning};
use mapper_identify::{DeclaredUncertainty, IdentifyConfig};
use mapper_numerics::coloured_noise::memory;
use mapper_numerics::statistics::quantile;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::SteadyState;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const TARGETS_RPM: [f64; 5] = [50e3, 70e3, 90e3, 110e3, 150e3];
/// Distances of the initial speed from each target speed; the initial speed must lie within [`FROM_RPM`].
const STEPS_RPM: [f64; 10] = [-100e3, -60e3, -40e3, -20e3, -5e3, 5e3, 20e3, 40e3, 60e3, 100e3];
const FROM_RPM: std::ops::RangeInclusive<f64> = 45e3..=155e3;
const OPENINGS: [f64; 3] = [0.5, 0.7, 1.0];
/// Number of campaigns: each has its own offsets, and each run its own noise.
pub(crate) const SEEDS: u64 = 6;

/// A good rig: one-sigma noise at 10 Hz, fixed offset, gain; SI units.
pub(crate) const RIG: [(Channel, f64, f64, f64); 7] = [
    (Channel::ShaftSpeed, 30.0, 0.0, 0.0),
    (Channel::CompressorFlow, 1.5e-4, 0.0, 0.005),
    (Channel::P1, 20.0, 50.0, 0.0),
    (Channel::P2, 60.0, 100.0, 0.0),
    (Channel::T1, 0.1, 0.25, 0.0),
    (Channel::T2, 0.1, 0.25, 0.0),
    (Channel::Tc, 0.15, 0.3, 0.0),
];
/// Lag of P3, s. Judgement: the paper's rig changes it "somewhat slower" than its model, which steps it.
pub(crate) const P3_LAG_S: f64 = 2.0;
/// Bins of |dT2|, K.
const BINS_K: [(f64, f64); 5] = [(0.0, 2.0), (2.0, 5.0), (5.0, 10.0), (10.0, 15.0), (15.0, f64::INFINITY)];

pub(crate) fn config() -> IdentifyConfig {
    let mut config = dynamic_config(0.0);
    for (channel, noise_sigma, offset_sigma, gain_sigma_ratio) in RIG {
        config.declared.insert(channel, DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio });
    }
    config
}

pub(crate) fn draw_errors(rng: &mut impl Rng) -> Vec<(f64, f64)> {
    let draw = |(_, _, offset, gain): &(Channel, f64, f64, f64)| {
        let [a, b]: [f64; 2] = [StandardNormal.sample(rng), StandardNormal.sample(rng)];
        (a * offset, b * gain)
    };
    RIG.iter().map(draw).collect()
}

/// White noise with 0.8 and first-order noise (2 s) with 0.6 of each sigma; offsets and gains as given.
pub(crate) fn add_sensor_errors(clean: &Recording, errors: &[(f64, f64)], rng: &mut impl Rng) -> Recording {
    let mut measured = clean.clone();
    for ((channel, sigma, ..), (offset, gain)) in RIG.into_iter().zip(errors) {
        let Some(series) = measured.series.get_mut(&channel) else { continue };
        let mut slow: f64 = StandardNormal.sample(rng);
        let mut last_s = 0.0;
        for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
            let decay = memory(t_s - last_s, 2.0);
            let [kick, white]: [f64; 2] = [StandardNormal.sample(rng), StandardNormal.sample(rng)];
            slow = decay * slow + (1.0 - decay * decay).sqrt() * kick;
            *value += offset + gain * *value + sigma * (0.8 * white + 0.6 * slow);
            last_s = *t_s;
        }
    }
    measured
}

fn runs() -> Result<Vec<Run>, ReproduceError> {
    let mut model = Model::nominal();
    model.params.t2_probe_diameter_m = PROBE_M;
    let mut runs = Vec::new();
    for opening in OPENINGS {
        for to_rpm in TARGETS_RPM {
            let from = STEPS_RPM.map(|step_rpm| to_rpm + step_rpm);
            for from_rpm in from.into_iter().filter(|from_rpm| FROM_RPM.contains(from_rpm)) {
                runs.push(run_lagged(&model, Jump { from_rpm, to_rpm, opening }, RUN_S, P3_LAG_S)?);
            }
        }
    }
    Ok(runs)
}

fn measured() -> Result<Vec<Outcome>, ReproduceError> {
    let (runs, config) = (runs()?, config());
    let mut all_outcomes = Vec::new();
    for seed in 0..SEEDS {
        let mut rng = Pcg64::seed_from_u64(seed);
        let errors = draw_errors(&mut rng);
        for run in &runs {
            all_outcomes.push(identify_recording(
                run,
                &add_sensor_errors(&run.recording, &errors, &mut rng),
                &config,
            )?);
        }
    }
    Ok(all_outcomes)
}

fn dt2_k(outcome: &Outcome) -> f64 {
    outcome.point.dt2_k.unwrap_or(0.0).abs()
}

fn within(outcome: &Outcome) -> Option<bool> {
    let (low, high) = outcome.point.eta_low.zip(outcome.point.eta_high)?;
    Some(low <= outcome.eta_end && outcome.eta_end <= high)
}

struct Bin<'a> {
    name: String,
    members: Vec<&'a Outcome>,
}

impl<'a> Bin<'a> {
    fn of(all_outcomes: &'a [Outcome], (low, high): (f64, f64)) -> Self {
        let name =
            if high.is_finite() { format!("{low:.0} to {high:.0}") } else { format!("above {low:.0}") };
        Bin { name, members: all_outcomes.iter().filter(|o| (low..high).contains(&dt2_k(o))).collect() }
    }

    fn rms(&self) -> Option<f64> {
        rms(self.members.iter().map(|o| o.eta_error_points()))
    }

    fn quantile(&self, share: f64) -> f64 {
        let errors = self.members.iter().filter_map(|o| o.eta_error_points()).map(f64::abs);
        quantile(errors, share).unwrap_or(f64::NAN)
    }
}

pub(crate) fn figure() -> Result<FigureResult, ReproduceError> {
    let all_outcomes = measured()?;
    let bins: Vec<Bin<'_>> = BINS_K.into_iter().map(|bin| Bin::of(&all_outcomes, bin)).collect();
    let moved =
        |o: &Outcome| o.point.warnings.iter().any(|warning| matches!(warning, Warning::FlowMoved { .. }));
    let selected = |from_k: f64, to_k: f64, steady: bool| {
        let wanted = |o: &&Outcome| (from_k..to_k).contains(&dt2_k(o)) && !(steady && moved(o));
        rms(all_outcomes.iter().filter(wanted).map(Outcome::eta_error_points)).unwrap_or(f64::NAN)
    };
    let (small, large) = (selected(0.0, 2.0, false), selected(15.0, f64::INFINITY, false));
    let (small_steady, large_steady) = (selected(0.0, 2.0, true), selected(15.0, f64::INFINITY, true));
    let mid = || all_outcomes.iter().filter(|o| [90e3, 110e3].contains(&o.jump.to_rpm) && dt2_k(o) >= 5.0);
    let slow = || all_outcomes.iter().filter(|o| o.jump.to_rpm == 50e3);
    let share = |outcomes: &mut dyn Iterator<Item = &Outcome>, limit: f64| {
        let (mut inside, mut all) = (0u32, 0u32);
        for outcome in outcomes {
            all += 1;
            inside += u32::from(outcome.eta_error_points().is_some_and(|e| e.abs() < limit));
        }
        100.0 * f64::from(inside) / f64::from(all.max(1))
    };
    let good: Vec<&Outcome> = all_outcomes.iter().filter(|o| o.point.verdict == PointVerdict::Good).collect();
    let good_worst = good.iter().filter_map(|o| o.eta_error_points()).map(f64::abs).fold(0.0, f64::max);
    let intervals: Vec<bool> = all_outcomes.iter().filter_map(within).collect();
    let good_intervals: Vec<bool> = good.iter().filter_map(|o| within(o)).collect();
    let coverage = |intervals: &[bool]| {
        100.0 * intervals.iter().filter(|inside| **inside).count() as f64 / intervals.len().max(1) as f64
    };
    let mid_rms = rms(mid().map(Outcome::eta_error_points)).unwrap_or(f64::NAN);
    let slow_rms = rms(slow().map(Outcome::eta_error_points)).unwrap_or(f64::NAN);
    let statements = vec![
        Statement::new(
            "The highest errors in efficiency occur with the smallest changes of T2; larger gradients give higher accuracy.",
            format!(
                "rms {} points below 2 K, {} above 15 K. Without the points that say that their flow moved: {} and {}. The largest jumps down to 50 krpm bring no gain, because the flow keeps moving after them.",
                fixed(small, 1),
                fixed(large, 1),
                fixed(small_steady, 1),
                fixed(large_steady, 1)
            ),
            Verdict::of(
                small > 1.2 * large && small_steady > 1.2 * large_steady,
                small_steady > 1.2 * large_steady,
            ),
        ),
        Statement::new(
            "On the rig the error at 90 and 110 krpm is less than 3 points (section 5.3).",
            format!(
                "{} % of the points below 3 points where T2 moves by 5 K or more (rms {} points).",
                fixed(share(&mut mid(), 3.0), 0),
                fixed(mid_rms, 1)
            ),
            Verdict::holds_if(share(&mut mid(), 3.0) > 90.0),
        ),
        Statement::new(
            "On the rig the method is poor at low speed: over-prediction by more than 10 points at 50 krpm.",
            format!(
                "rms {} points at 50 krpm, {} % of the points below 3 points, {} % below 10.",
                fixed(slow_rms, 1),
                fixed(share(&mut slow(), 3.0), 0),
                fixed(share(&mut slow(), 10.0), 0)
            ),
            if slow_rms > 2.0 * mid_rms { Verdict::Partly } else { Verdict::Differs },
        ),
        Statement::new(
            "(beyond the paper) Verdicts and intervals tell which points can be trusted.",
            format!(
                "{} of {} points are called good; the worst of these is {} points off. The 95 % intervals hold the model's final efficiency in {} % of all points, {} % of the good ones.",
                good.len(),
                all_outcomes.len(),
                fixed(good_worst, 1),
                fixed(coverage(&intervals), 0),
                fixed(coverage(&good_intervals), 0)
            ),
            Verdict::holds_if(coverage(&good_intervals) > 90.0),
        ),
    ];
    let mut table = Table::new([
        "change of T2, K",
        "points",
        "rms error, points",
        "median error (size), points",
        "95 % of the errors below, points",
        "called good",
        "intervals that hold the truth, %",
        "failed",
    ]);
    for bin in &bins {
        let inside: Vec<bool> = bin.members.iter().filter_map(|o| within(o)).collect();
        let good = bin.members.iter().filter(|o| o.point.verdict == PointVerdict::Good).count();
        table.row([
            bin.name.clone(),
            bin.members.len().to_string(),
            fixed(bin.rms().unwrap_or(f64::NAN), 2),
            fixed(bin.quantile(0.5), 2),
            fixed(bin.quantile(0.95), 2),
            good.to_string(),
            fixed(coverage(&inside), 0),
            bin.members.iter().filter(|o| o.point.eta.is_none()).count().to_string(),
        ]);
    }
    Ok(FigureResult {
        number: "12".to_owned(),
        title: "error against the size of the transient, on a noisy rig".to_owned(),
        method: format!(
            "Jumps of 5 to 100 krpm to 50, 70, 90, 110 and 150 krpm at openings 0.5, 0.7 and 1.0, {SEEDS} seeded campaigns \
             each with its own fixed offsets (T1, T2 0.25 K, Tc 0.3 K, P1 50 Pa, P2 100 Pa, flow 0.5 %) and coloured \
             noise (T1, T2 0.1 K, Tc 0.15 K, flow 0.15 g/s, P1 20 Pa, P2 60 Pa). T2 is read by a probe of 1.5 mm, \
             which the method takes for ideal, and P3 lags its command by {P3_LAG_S} s, both as on the paper's rig; alpha_A = 0 is known. There it \
             is unknown: only the trend of the paper's figure can be compared."
        ),
        statements,
        table,
        svg: picture(&all_outcomes),
    })
}

fn picture(all_outcomes: &[Outcome]) -> String {
    // Errors beyond the axis are drawn at its end.
    const EDGE_POINTS: f64 = 10.0;
    let panel = |title: &str, keep: &dyn Fn(&Outcome) -> bool| {
        let mut panel = Panel::new(
            Axis::new("change of T2 in the window (size), K").from(0.0),
            Axis::new("efficiency error, points").range(-EDGE_POINTS - 1.0, EDGE_POINTS + 1.0),
        )
        .title(title);
        for (verdict, colour, marker, hollow, label) in [
            (PointVerdict::Unusable, palette::GREY, Marker::Cross, true, "called unusable"),
            (PointVerdict::Doubtful, palette::ORANGE, Marker::Triangle, true, "called doubtful"),
            (PointVerdict::Good, palette::BLUE, Marker::Circle, false, "called good"),
        ] {
            let points: Vec<(f64, f64)> = all_outcomes
                .iter()
                .filter(|o| keep(o) && o.point.verdict == verdict)
                .filter_map(|o| Some((dt2_k(o), o.eta_error_points()?.clamp(-EDGE_POINTS, EDGE_POINTS))))
                .collect();
            if points.is_empty() {
                continue;
            }
            let scatter = Scatter::new(points, colour).marker(marker).size_px(5.0).label(label);
            panel.add(if hollow { scatter.hollow() } else { scatter });
        }
        for y in [-3.0, 3.0] {
            panel.add(Rule::new(RuleAt::Y(y)).label("3 points"));
        }
        panel
    };
    Figure::new("Figure 12: error against the size of the transient, on a noisy rig")
        .subtitle(format!(
            "{SEEDS} seeded campaigns; errors beyond {EDGE_POINTS:.0} points stand on the edge"
        ))
        .panel(panel("(a) to 50 and 70 krpm", &|o| o.jump.to_rpm < 80e3))
        .panel(panel("(b) to 90, 110 and 150 krpm", &|o| o.jump.to_rpm > 80e3))
        .to_svg()
}

/// Order of the speeds in one round of jumps: table 1 jumps between the slowest and the third, the second and the fastest.
const JUMP_ORDER: [usize; 4] = [0, 2, 1, 3];

fn gradients_k(visits: &[SteadyState]) -> Vec<f64> {
    visits.windows(2).map(|pair| (pair[1].state.tc_k - pair[0].state.tc_k).abs()).collect()
}

pub(crate) fn figure_13() -> Result<FigureResult, ReproduceError> {
    let machine = paper_machine();
    let settle = |speed_rpm: f64, opening: f64| settled_at(&machine, speed_rpm, opening);
    let speeds = target_speeds_rpm();
    // Along each line, to and fro.
    let mut lines = Vec::new();
    for (index, speed_rpm) in speeds.into_iter().enumerate() {
        for place in 0..lab::OPENINGS.len() {
            let place = if index % 2 == 0 { place } else { lab::OPENINGS.len() - 1 - place };
            lines.push(settle(speed_rpm, lab::OPENINGS[place])?);
        }
    }
    let mut jumps = Vec::new();
    for opening in lab::OPENINGS {
        for index in JUMP_ORDER {
            jumps.push(settle(speeds[index], opening)?);
        }
    }
    let (along, between) = (gradients_k(&lines), gradients_k(&jumps));
    let sum = |gradients: &[f64]| gradients.iter().sum::<f64>();
    let mean = |gradients: &[f64]| sum(gradients) / gradients.len() as f64;
    let statements = vec![
        Statement::new(
            "Along speed lines the small changes between points keep the time of thermal stabilisation short (section 6).",
            format!(
                "The settled housing changes by {} K a step along the lines, by {} K a step in jumps.",
                fixed(mean(&along), 1),
                fixed(mean(&between), 1)
            ),
            Verdict::holds_if(mean(&along) < mean(&between)),
        ),
        Statement::new(
            "Jumps between speed lines maximise the thermal gradient between points.",
            format!(
                "Sum over the map {} K in jumps, {} K along the lines. What that is worth to the errors: [orders](orders.md).",
                fixed(sum(&between), 0),
                fixed(sum(&along), 0)
            ),
            Verdict::holds_if(sum(&between) > 2.0 * sum(&along)),
        ),
        Statement::new(
            "Jumps allow a better detection of drift of the measurement.",
            "Of T2 and Tc, but not of pressures and flow: [drift and orders](drift_orders.md).".to_owned(),
            Verdict::Partly,
        ),
        Statement::new(
            "The method takes considerably less time than a full thermal characterisation, and than mapping that waits for stabilisation.",
            "Against mapping that waits: the column `steps, min` of [orders](orders.md). A characterisation by [11] needs several series on a rig."
                .to_owned(),
            Verdict::NeedsRig,
        ),
    ];
    let mut table = Table::new(["order", "steps", "mean gradient, K", "largest gradient, K", "sum, K"]);
    for (name, gradients) in [("(a) speed lines", &along), ("(b) jumps", &between)] {
        table.row([
            name.to_owned(),
            gradients.len().to_string(),
            fixed(mean(gradients), 1),
            fixed(gradients.iter().copied().fold(0.0, f64::max), 1),
            fixed(sum(gradients), 0),
        ]);
    }
    Ok(FigureResult {
        number: "13".to_owned(),
        title: "conventional and proposed order of the points".to_owned(),
        method: "Settled housing temperatures of the paper's machine (figure 11) at the 4 speeds and 5 openings, in both orders."
            .to_owned(),
        statements,
        table,
        svg: picture_of_orders(&lines, &jumps),
    })
}

fn picture_of_orders(lines: &[SteadyState], jumps: &[SteadyState]) -> String {
    let panel = |title: &str, visits: &[SteadyState]| {
        let at: Vec<(f64, f64)> =
            visits.iter().map(|s| (s.outputs.flow_corrected_kg_s, s.outputs.pressure_ratio)).collect();
        let mut panel =
            Panel::new(Axis::new("corrected mass flow, kg/s"), Axis::new("pressure ratio")).title(title);
        panel.add(Line::new(at.clone(), palette::GREY).width_px(1.0).arrows());
        panel.add(Scatter::new(at, palette::BLUE).marker(Marker::Circle));
        panel
    };
    Figure::new("Figure 13: orders of the points")
        .panel(panel("(a) conventional", lines))
        .panel(panel("(b) proposed", jumps))
        .to_svg()
}
