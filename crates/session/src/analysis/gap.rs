//! The diagnosis of a gap, and the experiments that it recommends.

use crate::analysis::diagnosis_file::{MadeFrom, next_to, read, refused, sealed};
use crate::analysis::identification::Identified;
use crate::plan::planning::{PlanInputs, nominal_model, plan};
use crate::recording::files::{DIAGNOSIS_FORMAT, Versioned};
use crate::recording::fusing::{FusedRecordings, fuse_sensors, recordings, take_air_and_probe};
use crate::recording::identification_config::{expected_rest, identification_with};
use crate::recording::recording_file::{Recorded, check_machine};
use crate::{Registry, Session, SessionError, SessionEvent, StoredDiagnosisError};
use mapper_campaign::Campaign;
use mapper_core::{
    IdentifiedPoint, Method, OperatingPoint, Recording, ResultRemark, RigMode, SetpointRanges, Setpoints,
    StepMarker,
};
use mapper_diagnose::gap;
use mapper_diagnose::gap::{
    AllowedJump, AlsoChanged, AtRest, BaselineRecording, Calibration, ClosureSearch, CorrectedMap,
    Correction, Diagnosed, Diagnosis, Expected, Experiment, ForecastCheck, Found, GapRequest, GapWarning,
    RigRecording,
};
use mapper_identify::{IdentifyConfig, ZeroSettings, expected_after_zero};
use mapper_observe::FusedChannel;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::reach;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_planner::PlanRequest;
use mapper_recording::{ChannelMap, ReadWarning};
use mapper_report::gap_page;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::slice;
use std::sync::Arc;

/// Result of a gap diagnosis.
pub struct Gap {
    /// The diagnosis with its inputs.
    pub diagnosed: Diagnosed,
    /// Result of sensor fusion.
    pub sensors: Vec<FusedChannel>,
    /// What it was made from.
    pub made_from: MadeFrom,
    /// The file that it was read from; `None` if it is new.
    pub stored: Option<PathBuf>,
    /// Why the file next to the recording was not used.
    pub not_used: Option<SessionError>,
}

impl Gap {
    /// Machine-readable output and content of its file: diagnosis, effects, drift, zero, and the fits from which others continue.
    pub fn json(&self) -> Result<Value, SessionError> {
        let Diagnosed { diagnosis, drift, zero, found, .. } = &self.diagnosed;
        let versioned = Versioned { format_version: DIAGNOSIS_FORMAT, content: diagnosis };
        let mut value = serde_json::to_value(versioned)?;
        value["candidates"] = json!(diagnosis.listed().collect::<Vec<_>>());
        // An effect that is present in both recordings belongs to the rig; it does not describe a complete machine.
        let is_complete = diagnosis.baseline.is_none();
        value["found"] = json!(found.as_ref().filter(|_| is_complete));
        // Without the individual points.
        value["drift"] = drift.as_ref().map_or(
            Value::Null,
            |drift| json!({"verdict": drift.verdict, "drifts": drift.drifts, "reason": drift.reason}),
        );
        value["zero"] = json!(zero);
        if !self.sensors.is_empty() {
            value["sensors"] = json!(self.sensors);
        }
        value["made_from"] = json!(self.made_from);
        value["fits"] = json!(self.diagnosed.stored());
        sealed(value)
    }

    /// The page of the diagnosis. `recording`: its name for the title.
    pub fn page(&self, machine: &str, recording: &str) -> Result<String, SessionError> {
        Ok(gap_page(machine, recording, &self.diagnosed, &self.diagnosed.evidence()?)?)
    }
}

impl Session<'_> {
    /// Diagnoses one recording with candidate effects.
    pub fn diagnose_gap(
        &self,
        recorded: &Recorded,
        campaign: &Campaign,
        map: &ChannelMap,
        effects: Vec<Arc<dyn Effect>>,
        baseline: Option<&Recorded>,
    ) -> Result<Gap, SessionError> {
        if effects.is_empty() {
            return Err(SessionError::NoEffects);
        }
        let progress = |done_ratio: f64, what: &str| {
            self.send(SessionEvent::Progress { done_ratio, what: what.to_owned() });
        };
        let made_from = MadeFrom::of(recorded, (campaign, map), &effects, baseline.is_some())?;
        let (recording, sensors) = fused(recorded, campaign, map)?;
        let of_baseline = |baseline: &Recorded| -> Result<BaselineRecording, SessionError> {
            let (recording, _) = fused(baseline, campaign, map)?;
            Ok(BaselineRecording { name: baseline.path.display().to_string(), recording })
        };
        let of_reader =
            |warning: &ReadWarning| GapWarning::RecordingIncomplete { reason: warning.to_string() };
        let diagnosed = gap(GapRequest {
            baseline: baseline.map(of_baseline).transpose()?,
            effects,
            experiments: experiments(self.registry, campaign, map, &recording.model)?,
            recording,
            closure_search: ClosureSearch::IfUnexplained,
            calibration: Calibration::shipped().map_err(SessionError::Calibration)?,
            warnings: recorded.read.warnings.iter().map(of_reader).collect(),
            progress: &progress,
        })?;
        Ok(Gap { diagnosed, sensors, made_from, stored: None, not_used: None })
    }

    /// Compares the machine found by a diagnosis with an independent recording. Nothing is fitted.
    pub fn check_forecast(
        &self,
        recorded: &Recorded,
        campaign: &Campaign,
        map: &ChannelMap,
        effects: Vec<Arc<dyn Effect>>,
        found: &Found,
    ) -> Result<ForecastCheck, SessionError> {
        let (recording, _) = fused(recorded, campaign, map)?;
        let calibration = Calibration::shipped().map_err(SessionError::Calibration)?;
        Ok(ForecastCheck::new(&recording, effects, found, &calibration)?)
    }

    /// Expected readings of the diagnosed machine at the end of each planned step of a campaign.
    pub fn forecast_calibrated_model(
        &self,
        campaign: &Campaign,
        map: &ChannelMap,
        effects: Vec<Arc<dyn Effect>>,
        found: &Found,
    ) -> Result<Vec<Expected>, SessionError> {
        let model = nominal_model(campaign)?;
        let steps = plan(campaign, &model)?.steps;
        let planned =
            Recording { steps: steps.iter().map(StepMarker::from).collect(), ..Recording::default() };
        let rig = of_rig(planned, model, identification_with(campaign, map), campaign);
        Ok(found.forecast(rig, effects)?)
    }
}

impl Session<'_> {
    /// The diagnosis of a recording: from the file `stored`, from the file next to the recording if it belongs to it, or a new one.
    pub fn gap(
        &self,
        recorded: &Recorded,
        (campaign, map): (&Campaign, &ChannelMap),
        effects: Vec<Arc<dyn Effect>>,
        stored: Option<&Path>,
    ) -> Result<Gap, SessionError> {
        if let Some(path) = stored {
            return self.restored(path, recorded, (campaign, map), effects);
        }
        let path = next_to(recorded);
        let found = path.is_file().then(|| self.restored(&path, recorded, (campaign, map), effects.clone()));
        let not_used = match found.transpose() {
            Ok(Some(gap)) => return Ok(gap),
            Ok(None) => None,
            Err(error) => Some(error),
        };
        Ok(Gap { not_used, ..self.diagnose_gap(recorded, campaign, map, effects, None)? })
    }

    fn restored(
        &self,
        path: &Path,
        recorded: &Recorded,
        (campaign, map): (&Campaign, &ChannelMap),
        effects: Vec<Arc<dyn Effect>>,
    ) -> Result<Gap, SessionError> {
        let (file, text) = read(path)?;
        let (Some(made_from), Some(fits)) = (file.made_from, file.fits) else {
            let why = StoredDiagnosisError::NotADiagnosis("it has no fits".to_owned());
            return Err(refused(path, why));
        };
        let wanted = MadeFrom::of(recorded, (campaign, map), &effects, false)?;
        made_from.check(&wanted).map_err(|error| refused(path, error))?;
        let diagnosis: Diagnosis = serde_json::from_str(&text)
            .map_err(|error| refused(path, StoredDiagnosisError::NotADiagnosis(error.to_string())))?;
        let (rig, sensors) = fused(recorded, campaign, map)?;
        let diagnosed = Diagnosed::restored((diagnosis, file.drift, file.found), fits, &rig, effects)
            .map_err(|error| refused(path, error.into()))?;
        Ok(Gap { diagnosed, sensors, made_from, stored: Some(path.to_owned()), not_used: None })
    }
}

fn fused(
    recorded: &Recorded,
    campaign: &Campaign,
    map: &ChannelMap,
) -> Result<(RigRecording, Vec<FusedChannel>), SessionError> {
    check_machine(recorded, campaign)?;
    let mut model = nominal_model(campaign)?;
    let config = identification_with(campaign, map);
    let FusedRecordings { recordings, config, channels } =
        fuse_sensors(recordings(slice::from_ref(recorded)), config, Some(campaign), map)
            .with_total_pressures(campaign);
    take_air_and_probe(&mut model, &config);
    let recording = recordings.into_iter().next().unwrap_or_default();
    let sensors = channels.into_iter().next().unwrap_or_default();
    Ok((of_rig(recording, model, config, campaign), sensors))
}

fn of_rig(
    recording: Recording,
    model: Model,
    identification: IdentifyConfig,
    campaign: &Campaign,
) -> RigRecording {
    RigRecording {
        recording,
        model,
        identification,
        zero: campaign.zero,
        boundary: campaign.boundary,
        tolerances: campaign.tolerances,
        actuators: campaign.actuators,
        tolerances_declared: campaign.tolerances_declared,
        has_drift_search: true,
    }
}

pub struct GapCorrection {
    pub gap: Gap,
    pub map: CorrectedMap,
    /// Identification of the corrected readings with the uncertainty of the correction; if nothing was corrected, widened by the open causes.
    pub identified: Identified,
}

impl Session<'_> {
    /// Identifies a diagnosed recording again without the causes found. With `directory`, writes the results of an identification there.
    pub fn correct_gap(
        &self,
        gap: Gap,
        recorded: &Recorded,
        map: &ChannelMap,
        method: Option<Method>,
        directory: Option<&Path>,
    ) -> Result<GapCorrection, SessionError> {
        self.send(SessionEvent::Progress { done_ratio: 1.0, what: "identification".to_owned() });
        let quiet = Session::new(self.registry);
        let identify = |recording: Recording| {
            let mut recorded = recorded.clone();
            recorded.read.recording = recording;
            quiet.identify(vec![recorded], map, method)
        };
        let points = |identified: &Identified| -> Vec<IdentifiedPoint> {
            identified.points_alone().cloned().collect()
        };
        let correction = gap.diagnosed.correct(&recorded.read.recording, identify, &points)?;
        let (identified, map) = widened(correction, &gap);
        if let Some(directory) = directory {
            let identified = identified.clone();
            self.write_identification(vec![recorded.clone()], directory, |_| Ok(identified))?;
        }
        Ok(GapCorrection { gap, map, identified })
    }
}

/// The identification with the uncertainty of its correction, or of causes that are not corrected, and with what the correction rests on.
fn widened(correction: Correction<Identified>, gap: &Gap) -> (Identified, CorrectedMap) {
    let Correction { mut identified, map, added } = correction;
    let is_corrected = map.refused.is_none();
    for (scored, added) in identified.points.iter_mut().zip(&added) {
        added.widen(&mut scored.point);
        let step = scored.point.step;
        let budgets = identified.budgets.iter_mut().filter(|budgets| is_corrected && budgets.step == step);
        budgets.for_each(|budgets| added.add_to(budgets));
    }
    if is_corrected {
        identified.corrections.clone_from(&map.points);
        identified.remarks.extend(map.causes.iter().map(|cause| ResultRemark::Corrected {
            causes: cause.names.clone(),
            probability: cause.probability,
        }));
        let subtracted = |reason: &String| ResultRemark::DriftSubtracted { reason: reason.clone() };
        identified.remarks.extend(gap.diagnosed.drift.as_ref().map(|drift| subtracted(&drift.reason)));
    } else {
        identified.remarks.extend(widened_remark(&map));
    }
    (identified, map)
}

/// States that intervals are wider because of causes that the map is not corrected for; `None` if none is.
fn widened_remark(map: &CorrectedMap) -> Option<ResultRemark> {
    let largest_sigma = map.points.iter().map(|point| point.correction_sigma).fold(0.0, f64::max);
    let causes = map.causes.iter().map(|cause| cause.names.join(" + ")).collect();
    (largest_sigma > 0.0).then_some(ResultRemark::WidenedByGap { causes, largest_sigma })
}

/// Maximum number of points for which all jumps are simulated to check the limits.
const MAX_POINTS: usize = 40;
/// Candidate changes of turbine inlet temperature and oil temperature, K.
const T3_STEPS_K: [f64; 3] = [100.0, 50.0, -100.0];
const OIL_STEPS_K: [f64; 2] = [40.0, -20.0];
/// Margin to the maximum T3, K. The test cell fluctuates, sensors may read high, and a guard watches this limit.
const T3_MARGIN_K: f64 = 15.0;
/// Duration of such a step, s. Housings need minutes to respond.
const DWELL_S: f64 = 300.0;
/// Duration of a soak, s, as in the shipped campaigns.
const SOAK_S: f64 = 1800.0;

pub(crate) fn experiments(
    registry: &Registry,
    campaign: &Campaign,
    map: &ChannelMap,
    model: &Model,
) -> Result<Vec<Experiment>, SessionError> {
    let mut all: Vec<Experiment> =
        allowed_jumps(campaign, model)?.into_iter().map(Experiment::jump).collect();
    // Temperature steps need a declared range of accepted setpoints.
    if let Some(accepts) = registry.setpoint_ranges(campaign, model) {
        let places = corners(&campaign.points);
        all.extend(places.iter().flat_map(|point| temperature_steps(campaign, model, *point, &accepts)));
    }
    all.extend(soak(campaign, map));
    Ok(all)
}

fn soak(campaign: &Campaign, map: &ChannelMap) -> Option<Experiment> {
    if campaign.zero.is_some() {
        return None;
    }
    let settings = ZeroSettings::default();
    let residual_sigma =
        expected_after_zero(identification_with(campaign, map), &settings, SOAK_S, expected_rest(campaign))
            .declared;
    let offset_sigma_k = |channel| {
        residual_sigma
            .get(&channel)
            .map_or(settings.temperature_sigma_k, |residual_sigma| residual_sigma.offset_sigma)
    };
    let soak = AtRest {
        duration_s: SOAK_S,
        left_sigma_k: std::array::from_fn(|place| offset_sigma_k(AtRest::CHANNELS[place])),
    };
    let rest =
        OperatingPoint { speed_rpm: 0.0, valve_opening_ratio: campaign.points.first()?.valve_opening_ratio };
    let jump = AllowedJump { from: rest, to: rest, from_p3_pa: 0.0, to_p3_pa: 0.0, dwell_s: SOAK_S };
    Some(Experiment { jump, also: AlsoChanged::Soak(soak) })
}

/// Jumps between the campaign's points that the planner allows. Empty for grids too large to simulate and for campaigns without a grid.
fn allowed_jumps(campaign: &Campaign, model: &Model) -> Result<Vec<AllowedJump>, SessionError> {
    if campaign.points.len() > MAX_POINTS {
        return Ok(Vec::new());
    }
    let inputs = PlanInputs::of(campaign)?;
    // The check of a jump does not depend on the expected error after it.
    let request = PlanRequest { method: None, ..inputs.request(campaign, model) };
    let Ok(jumps) = mapper_planner::forecast_all_jumps(&request) else { return Ok(Vec::new()) };
    let allowed = jumps.iter().filter(|jump| jump.rejections.is_empty());
    Ok(allowed
        .map(|jump| AllowedJump {
            from: jump.from,
            to: jump.to,
            from_p3_pa: jump.p3_pa - jump.p3_change_pa,
            to_p3_pa: jump.p3_pa,
            dwell_s: request.timing.dwell.fixed_or_usual_s(),
        })
        .collect())
}

/// The slowest and the fastest points, each with the smallest and the largest opening.
fn corners(points: &[OperatingPoint]) -> Vec<OperatingPoint> {
    let mut sorted = points.to_vec();
    let key = |p: &OperatingPoint| (p.speed_rpm, p.valve_opening_ratio);
    sorted.sort_by(|a, b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let lines: Vec<&[OperatingPoint]> = sorted.chunk_by(|a, b| a.speed_rpm == b.speed_rpm).collect();
    let ends = [lines.first(), lines.last()].into_iter().flatten();
    let mut corners: Vec<OperatingPoint> =
        ends.flat_map(|line| [line.first(), line.last()]).flatten().copied().collect();
    corners.dedup();
    corners
}

fn temperature_steps(
    campaign: &Campaign,
    model: &Model,
    point: OperatingPoint,
    accepts: &SetpointRanges,
) -> Vec<Experiment> {
    let now = campaign.boundary;
    let is_below_limit =
        |to_k: &f64| campaign.limits.t3_max_k.is_none_or(|limit_k| *to_k <= limit_k - T3_MARGIN_K);
    let held = |boundary: &BoundaryConditions| {
        let steady = reach(model, point, boundary, campaign.follow_outlet, &campaign.limits).ok()?;
        let BoundaryConditions { p3_pa, t3_k, oil_temperature_k, .. } = steady.boundary;
        let valve_opening_ratio = point.valve_opening_ratio;
        let setpoints =
            Setpoints { mode: RigMode::Running, p3_pa, t3_k, valve_opening_ratio, oil_temperature_k };
        accepts.check(&setpoints).is_ok().then_some(p3_pa)
    };
    let Some(from_p3_pa) = held(&now) else { return Vec::new() };
    let step = |to_p3_pa: f64, also: AlsoChanged| Experiment {
        jump: AllowedJump { from: point, to: point, from_p3_pa, to_p3_pa, dwell_s: DWELL_S },
        also,
    };
    let (t3_k, oil_k) = (now.t3_k, now.oil_temperature_k);
    let t3_follows = campaign.follow_outlet.turbine_inlet;
    let to_k = T3_STEPS_K.iter().filter(|_| !t3_follows).map(|by_k| t3_k + by_k).filter(is_below_limit);
    let t3_steps = to_k.filter_map(|to_k| {
        Some(step(held(&BoundaryConditions { t3_k: to_k, ..now })?, AlsoChanged::T3 { from_k: t3_k, to_k }))
    });
    let oil_steps = OIL_STEPS_K.iter().filter(|_| !campaign.follow_outlet.oil).filter_map(|by_k| {
        let to_k = oil_k + by_k;
        let held_pa = held(&BoundaryConditions { oil_temperature_k: to_k, ..now })?;
        Some(step(held_pa, AlsoChanged::Oil { from_k: oil_k, to_k }))
    });
    t3_steps.chain(oil_steps).collect()
}
