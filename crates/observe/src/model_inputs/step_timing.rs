//! Estimates when each step's command reached the rig, and the scatter of the sample times. A run in real time can be late because of a disk,
//! a busy computer or a slow controller.
//!
//! The recorded command gives the time to within one sample. The remaining error shows in the measured P3, which changes by tens of kPa a
//! second after a jump. An equal delay of all jumps belongs to the actuator and stays in its response; different delays belong to the run.

use crate::averages::{TIME_ROUNDING_S, Table};
use crate::model_inputs::lagged_command::{LaggedCommand, Level, Response, levels_of_step};
use mapper_core::{Channel, Recording, StepMarker, is_same_command};
use mapper_numerics::root::minimise;
use mapper_numerics::statistics::{DOUBT_SIGMAS, mean, median, rms, robust_sigma};
use std::ops::Range;

/// Minimum jump of P3 for its timing, in noise of a sample. Bound: a time is then known to a hundredth of the rise.
const MIN_TIMED_JUMP_SIGMAS: f64 = 100.0;
/// Step of the derivative by time, s. Bound: between rounding and curvature.
const SLOPE_STEP_S: f64 = 1e-3;
/// Tolerance of a delay, s. Bound: far below its error.
const SHIFT_TOLERANCE_S: f64 = 1e-5;
/// Minimum information of a jump about its time. Bound: excludes division by zero.
const MIN_INFORMATION: f64 = 1e-12;
/// Variance of a time minus the mean of its neighbours, for unit variance of each. Source: 1 + 2/4.
const IRREGULARITY_VARIANCE: f64 = 1.5;
/// Standard deviations of chi-square above which times are irregular; neighbouring triples share samples, which doubles its scatter. Bound:
/// by chance once in a million recordings.
const MIN_IRREGULARITY_SIGMAS: f64 = 5.0;

/// Maximum delay of a command behind its step's start, s; a later one belongs to another change. Bound: a later one belongs to another
/// change.
const MAX_COMMAND_DELAY_S: f64 = 2.0;
/// Maximum sample spacing of a command for the timing of its change, s. Bound: a coarser log does not show when it changed.
const MAX_COMMAND_SPACING_S: f64 = 1.0;
/// Time before a jump over which P3 is averaged, s. Bound: thirty samples at 10 Hz.
const LEVEL_WINDOW_S: f64 = 3.0;
/// Minimum change of P3, in standard deviations of its scatter. Bound: by chance never exceeded.
const MIN_CHANGE_SIGMAS: f64 = 6.0;
/// Minimum change of P3, ratio to the jump. Bound: a speed controller changes it by less between two samples.
const MIN_CHANGE_RATIO: f64 = 0.02;
/// Time before and after a jump of P3 that is used for its timing, s. Bound: a level before, and the rise.
const AROUND_S: (f64, f64) = (1.0, 3.0);
/// The jumps are timed separately if they differ by more than this, s, and by more than [`DOUBT_SIGMAS`]. Bound: a smaller one has no
/// effect on the fit.
const MIN_DIFFERENCE_S: f64 = 3e-3;
/// Scatter of the sample times below which it is neglected, s. Bound: a hundredth of the sample interval.
const MIN_SCATTER_S: f64 = 1e-3;
/// Minimum rate of P3 for the timing of samples, in noise sigmas per second. Bound: a sample then has a time error below 0.02 s.
const MIN_RATE_SIGMAS_PER_S: f64 = 50.0;

/// Moves the start of each step to the last sample before its command changed, so that the step includes its whole transient.
pub fn with_command_times(recording: &Recording) -> Recording {
    let mut corrected = recording.clone();
    for index in 0..corrected.steps.len() {
        let (before_s, start_s) =
            (recording.steps[index].start_s, command_s(recording, &recording.steps[index]));
        corrected.steps[index].start_s = start_s;
        // Keep adjacent steps adjacent.
        if let Some(last) = index.checked_sub(1).map(|last| &mut corrected.steps[last])
            && last.end_s >= before_s - TIME_ROUNDING_S
        {
            last.end_s = start_s;
        }
    }
    corrected
}

/// Time of the last sample before the command of a step changed, s.
fn command_s(recording: &Recording, step: &StepMarker) -> f64 {
    let commands = [(Channel::P3Command, step.p3_pa), (Channel::ValveCommand, step.valve_opening_ratio)];
    let late = |(channel, commanded): (Channel, f64)| {
        let command = recording.series.get(&channel)?;
        let before = command.held(step.start_s)?;
        let (t_s, values) = command.slice(step.start_s, (step.start_s + MAX_COMMAND_DELAY_S).min(step.end_s));
        let unchanged = values.iter().take_while(|value| is_same_command(**value, before)).count();
        let after = values.get(unchanged)?;
        // A jump arrives at once, a ramp begins on its way.
        let share = (after - before) / (commanded - before);
        let is_on_the_way = is_same_command(*after, commanded) || (0.0..=1.0).contains(&share);
        (unchanged > 0 && !is_same_command(before, commanded) && is_on_the_way).then(|| t_s[unchanged - 1])
    };
    let late_s = commands.into_iter().find_map(late).map(|late_s| late_s.max(step.start_s));
    late_s.or_else(|| sampled_delay_s(recording, step)).unwrap_or(step.start_s)
}

/// If a log has the command only at its samples, a step begins with the first sample of the new command. If measured P3 has changed by
/// that sample, the rig received the command earlier: this returns the time of the previous sample, s.
fn sampled_delay_s(recording: &Recording, step: &StepMarker) -> Option<f64> {
    let (command, p3) = (recording.series.get(&Channel::P3Command)?, recording.series.get(&Channel::P3)?);
    let first = command.t_s.partition_point(|t_s| *t_s < step.start_s);
    let place = first.checked_sub(1)?;
    let (before_s, before_pa) = (command.t_s[place], command.values[place]);
    let after_pa = command.values.get(first).copied().filter(|_| command.t_s[first] == step.start_s)?;
    let jump_pa = after_pa - before_pa;
    if is_same_command(before_pa, after_pa) || step.start_s - before_s > MAX_COMMAND_SPACING_S {
        return None;
    }
    // Scatter of P3 at a constant command.
    let constant = p3.slice(step.start_s - LEVEL_WINDOW_S, before_s + TIME_ROUNDING_S).1;
    let level_pa = median(constant.iter().filter(|value| value.is_finite()))?;
    let scatter_pa = robust_sigma(constant.iter().map(|value| value - level_pa))?;
    let measured_pa = p3
        .held(step.start_s)
        .filter(|_| p3.t_s.binary_search_by(|t_s| t_s.total_cmp(&step.start_s)).is_ok())?;
    let change_pa = (measured_pa - level_pa) * jump_pa.signum();
    (change_pa > MIN_CHANGE_SIGMAS * scatter_pa && change_pa > MIN_CHANGE_RATIO * jump_pa.abs())
        .then_some(before_s)
}

/// Times estimated from the measured P3.
#[derive(Debug, Clone, PartialEq)]
pub struct Times {
    /// Time at which the command of each step reached the rig, s.
    pub starts_s: Vec<f64>,
    /// Scatter of the sample times, one standard deviation, s.
    pub scatter_s: f64,
}

impl Times {
    /// Estimates the times of a recording [with command-based step starts](with_command_times) whose P3 follows its command with this response.
    pub fn read(table: &Table, recording: &Recording, p3: Response, noise_sigma: f64) -> Times {
        let steps = &recording.steps;
        let mut times = Times { starts_s: steps.iter().map(|step| step.start_s).collect(), scatter_s: 0.0 };
        let Some(values) = table.column(Channel::P3) else { return times };
        let jumps = Jump::of_recording(table, recording, p3, noise_sigma);
        let shifts: Vec<(f64, f64)> = jumps.iter().map(|jump| jump.shift_s(table, values)).collect();
        let Some(common_s) = median(shifts.iter().map(|(shift_s, _)| *shift_s)) else { return times };
        let difference_sigmas = rms(shifts.iter().map(|(shift_s, error_s)| (shift_s - common_s) / error_s));
        let difference_s = rms(shifts.iter().map(|(shift_s, _)| shift_s - common_s));
        if difference_sigmas > Some(DOUBT_SIGMAS) && difference_s > Some(MIN_DIFFERENCE_S) {
            for (jump, (shift_s, _)) in jumps.iter().zip(&shifts) {
                times.starts_s[jump.step] += shift_s;
            }
        }
        times.scatter_s = scatter_s(table, values, &jumps, &shifts);
        times
    }

    /// The recording with each step starting when its command reached the rig.
    pub fn timed(&self, recording: &Recording) -> Recording {
        let mut timed = recording.clone();
        for (step, start_s) in timed.steps.iter_mut().zip(&self.starts_s) {
            step.start_s = *start_s;
        }
        timed
    }
}

/// A jump of P3 at the start of a step.
struct Jump {
    step: usize,
    levels: Vec<Level>,
    /// Position of the step's first level.
    at: usize,
    p3: Response,
    noise_sigma: f64,
    interval_s: f64,
    samples: Range<usize>,
}

impl Jump {
    fn of_recording(table: &Table, recording: &Recording, p3: Response, noise_sigma: f64) -> Vec<Jump> {
        let steps = &recording.steps;
        let jump = |step: usize| {
            let (before, marker) = (&steps[step - 1], &steps[step]);
            let mut levels = levels_of_step(recording, before);
            let at = levels.len();
            levels.extend(levels_of_step(recording, marker));
            let from_pa = levels[at - 1].p3_pa;
            let samples = table.range(marker.start_s - AROUND_S.0, marker.start_s + AROUND_S.1);
            ((marker.p3_pa - from_pa).abs() > MIN_TIMED_JUMP_SIGMAS * noise_sigma && samples.len() > 10)
                .then_some(Jump { step, levels, at, p3, noise_sigma, interval_s: table.interval_s, samples })
        };
        (1..steps.len()).filter_map(jump).collect()
    }

    /// P3 according to its command, delayed by this time.
    fn command(&self, shift_s: f64) -> LaggedCommand {
        let mut levels = self.levels.clone();
        levels[self.at..].iter_mut().for_each(|level| level.start_s += shift_s);
        LaggedCommand::new(levels, self.p3, Response::lag(0.0))
    }

    /// Residual of the measured P3, minus its mean, so that no offset enters.
    fn residuals(&self, table: &Table, values: &[f64], shift_s: f64) -> Vec<f64> {
        let command = self.command(shift_s);
        let residual = |i: usize| values[i] - command.p3_pa(table.t_s[i]);
        let residuals: Vec<f64> = self.samples.clone().map(residual).collect();
        let mean = mean(residuals.iter().filter(|residual| residual.is_finite())).unwrap_or(0.0);
        residuals.iter().map(|residual| residual - mean).collect()
    }

    /// Rate of P3 at each sample, Pa/s.
    fn slopes(&self, table: &Table, shift_s: f64) -> Vec<f64> {
        let (command, step_s) = (self.command(shift_s), SLOPE_STEP_S);
        let start_s = self.levels[self.at].start_s + shift_s;
        let slope = |t_s: f64| (command.p3_pa(t_s + step_s) - command.p3_pa(t_s)) / step_s;
        self.samples.clone().map(|i| if table.t_s[i] > start_s { slope(table.t_s[i]) } else { 0.0 }).collect()
    }

    /// Delay of the command relative to its sample, and its error, s.
    fn shift_s(&self, table: &Table, values: &[f64]) -> (f64, f64) {
        let cost = |shift_s: f64| {
            let residuals = self.residuals(table, values, shift_s);
            residuals
                .iter()
                .filter(|residual| residual.is_finite())
                .map(|residual| residual * residual)
                .sum::<f64>()
        };
        // The command came between two samples, and acts within one sample interval.
        let (low_s, high_s) = (-0.5 * self.interval_s, 2.0 * self.interval_s);
        let shift_s = minimise(low_s, high_s, SHIFT_TOLERANCE_S, cost).at;
        let information: f64 = self.slopes(table, shift_s).iter().map(|slope| slope * slope).sum();
        (shift_s, self.noise_sigma / information.max(MIN_INFORMATION).sqrt())
    }
}

/// Scatter of the sample times, from irregular P3 after jumps. Each sample is compared with its two neighbours, so that smooth differences
/// cancel, such as a response other than the assumed one.
fn scatter_s(table: &Table, values: &[f64], jumps: &[Jump], shifts: &[(f64, f64)]) -> f64 {
    let (mut sum, mut weights, mut chi, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (jump, (shift_s, _)) in jumps.iter().zip(shifts) {
        let (residuals, slopes) = (jump.residuals(table, values, *shift_s), jump.slopes(table, *shift_s));
        let noise_sigma = jump.noise_sigma;
        for (residuals, slopes) in residuals.windows(3).zip(slopes.windows(3)) {
            if slopes.iter().any(|slope| slope.abs() < MIN_RATE_SIGMAS_PER_S * noise_sigma) {
                continue;
            }
            let delay_s = |i: usize| -residuals[i] / slopes[i];
            let irregularity_s = delay_s(1) - 0.5 * (delay_s(0) + delay_s(2));
            let variance = |i: usize, share: f64| (share * noise_sigma / slopes[i]).powi(2);
            let noise = variance(0, 0.5) + variance(1, 1.0) + variance(2, 0.5);
            if irregularity_s.is_finite() {
                let weight = 1.0 / noise;
                sum += weight * (irregularity_s * irregularity_s - noise);
                weights += IRREGULARITY_VARIANCE * weight;
                chi += irregularity_s * irregularity_s / noise;
                count += 1.0;
            }
        }
    }
    let chi_limit = count + MIN_IRREGULARITY_SIGMAS * 2.0 * f64::sqrt(2.0 * count);
    let scatter_s = f64::sqrt(f64::max(sum / f64::max(weights, f64::MIN_POSITIVE), 0.0));
    if count > 0.0 && chi > chi_limit && scatter_s > MIN_SCATTER_S { scatter_s } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Series, StepKind};
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    const NOISE_PA: f64 = 80.0;
    const LAG: Response = Response::lag(0.3);

    /// Twelve steps of 20 s between 150 and 200 kPa at 10 Hz, with the given delay of each command and time error of each sample.
    fn recorded(late_s: &[f64; 12], scatter_s: f64) -> Recording {
        let mut random = Pcg64::seed_from_u64(4);
        let steps: Vec<StepMarker> = (0..12)
            .map(|index| {
                let (kind, start_s, up) = (StepKind::Point, 20.0 * index as f64, (index % 2) as f64);
                StepMarker {
                    index,
                    kind,
                    start_s,
                    end_s: start_s + 20.0,
                    from: None,
                    to: None,
                    p3_pa: 150e3 + 50e3 * up,
                    valve_opening_ratio: 0.7,
                }
            })
            .collect();
        let levels: Vec<Level> = steps
            .iter()
            .zip(late_s)
            .map(|(step, late_s)| {
                let (start_s, p3_pa) = (step.start_s + late_s, step.p3_pa);
                Level { start_s, p3_pa, valve_opening_ratio: step.valve_opening_ratio }
            })
            .collect();
        let truth = LaggedCommand::new(levels, LAG, Response::lag(0.0));
        let t_s: Vec<f64> = (0..2400).map(|i| f64::from(i) / 10.0).collect();
        // A driver reports the command at once; the next sample shows it.
        let commanded = t_s.iter().map(|t| truth.levels()[truth.level(t - 1e-9)].p3_pa).collect();
        let read = t_s
            .iter()
            .map(|t| {
                let (off, noise): (f64, f64) = (random.sample(StandardNormal), random.sample(StandardNormal));
                truth.p3_pa(t + scatter_s * off) + NOISE_PA * noise + 150.0
            })
            .collect();
        let series = [
            (Channel::P3, Series { t_s: t_s.clone(), values: read }),
            (Channel::P3Command, Series { t_s, values: commanded }),
        ];
        Recording { series: series.into(), steps, ..Recording::default() }
    }

    fn read(recording: &Recording) -> (Recording, Times) {
        let aligned = with_command_times(recording);
        let table = Table::new(&aligned).unwrap();
        let times = Times::read(&table, &aligned, LAG, NOISE_PA);
        (aligned, times)
    }

    #[test]
    fn a_run_in_simulated_time_is_left_as_it_is() {
        let recording = recorded(&[0.0; 12], 0.0);
        let (aligned, times) = read(&recording);
        assert_eq!(aligned, recording);
        assert_eq!(times.scatter_s, 0.0);
        assert_eq!(times.timed(&aligned), recording);
    }

    /// A logger's table: no step marks, the new command in the first row after the jump.
    #[test]
    fn a_command_that_was_seen_a_sample_late_is_put_before_it() {
        let recording = recorded(&[0.0; 12], 0.0);
        let mut seen = recording.clone();
        for index in 1..12 {
            seen.steps[index].start_s += 0.1;
            seen.steps[index - 1].end_s = recording.steps[index - 1].end_s;
        }
        let (aligned, times) = read(&seen);
        assert_eq!(times.timed(&aligned).steps, recording.steps);
        // If P3 has not moved by that sample, the command came with it.
        let mut with_it = seen.clone();
        let p3 = with_it.series.get_mut(&Channel::P3).unwrap();
        p3.t_s.iter_mut().for_each(|t_s| *t_s = (*t_s * 10.0).round() / 10.0 + 0.1);
        let (aligned, _) = read(&with_it);
        let starts =
            |recording: &Recording| recording.steps.iter().map(|step| step.start_s).collect::<Vec<_>>();
        assert_eq!(starts(&aligned), starts(&seen));
    }

    #[test]
    fn the_start_of_late_steps_is_read_from_command_and_p3() {
        let late_s = [0.0, 0.412, 0.02, 0.07, 0.0, 0.133, 0.25, 0.04, 0.01, 0.09, 0.055, 0.003];
        for scatter_s in [0.0, 0.012] {
            let recording = recorded(&late_s, scatter_s);
            let (aligned, times) = read(&recording);
            assert_eq!(aligned.steps[1].start_s, 20.4, "the last sample before the change");
            assert_eq!(aligned.steps[0].end_s, 20.4);
            // A dozen samples of each jump determine its time.
            let error_s = (2.0 * scatter_s).max(3e-3);
            for (index, late_s) in late_s.iter().enumerate().skip(1) {
                let off_s = times.starts_s[index] - (recording.steps[index].start_s + late_s);
                assert!(off_s.abs() < error_s, "{scatter_s}: step {index} by {off_s}");
            }
            let found_s = times.scatter_s;
            let right =
                if scatter_s == 0.0 { found_s == 0.0 } else { (found_s / scatter_s - 1.0).abs() < 0.35 };
            assert!(right, "{found_s} for {scatter_s}");
        }
    }
}
