//! Explains the gap between nominal model and rig: drift search first, then zero subtraction, then diagnosis.

use crate::analysis::experiments::experiments;
use crate::plan::planning::nominal_model;
use crate::plan::planning::plan;
use crate::recording::fusing::{FusedRecordings, fuse_sensors, recordings, take_air_and_probe};
use crate::recording::identification_config::identification_with;
use crate::recording::recording_file::{Recorded, check_machine};
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, Recording, Soak, StepMarker};
use mapper_diagnose::closure::discover::discover;
use mapper_diagnose::drift::{CauseKind, DriftReport, without_drift};
use mapper_diagnose::gap::best_fit::adequacy::adequacy;
use mapper_diagnose::gap::best_fit::fit::{Effort, fit};
use mapper_diagnose::gap::best_fit::selection::Selection;
use mapper_diagnose::gap::calibrated_model::{
    Expected, ForecastCheck, Found, check_forecast, forecast_steps,
};
use mapper_diagnose::gap::causes::calibration::Calibration;
use mapper_diagnose::gap::diagnose::{Diagnosed, GapError, GapRequest, diagnose};
use mapper_diagnose::gap::findings::report::{Diagnosis, Next, Verdict, law_found};
use mapper_diagnose::gap::findings::warning::{GapWarning, OffsetAtRest};
use mapper_diagnose::gap::model_error::healthy::Healthy;
use mapper_diagnose::gap::next_experiment::best_experiment::sensor_near;
use mapper_diagnose::gap::next_experiment::outlook::SimulatedRig;
use mapper_diagnose::gap::preconditions::usable::checked_study;
use mapper_diagnose::gap::residuals::actuators::Actuators;
use mapper_diagnose::gap::residuals::whiten::Linearised;
use mapper_identify::{ZeroOutcome, ZeroSettings};
use mapper_observe::model_inputs::lagged_command::Response;
use mapper_observe::{Declared, FusedChannel};
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_recording::{ChannelMap, ReadWarning};
use mapper_report::page::gap_page;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::slice;
use std::sync::Arc;

/// Result of a gap diagnosis.
pub struct Gap {
    /// The diagnosis with its inputs.
    pub diagnosed: Diagnosed,
    /// Drift during the recording; `None` if none was found or none can be detected, for example without repeats.
    pub drift: Option<DriftReport>,
    /// Result of sensor fusion.
    pub sensors: Vec<FusedChannel>,
    /// Result of the isothermal zero.
    pub zero: ZeroOutcome,
}

impl Gap {
    /// Machine-readable output: diagnosis, identified effects, drift and zero.
    ///
    /// # Errors
    /// [`SessionError::Json`]: none in practice.
    pub fn json(&self) -> Result<Value, SessionError> {
        let mut value = serde_json::to_value(&self.diagnosed.diagnosis)?;
        value["candidates"] = json!(self.diagnosed.diagnosis.listed().collect::<Vec<_>>());
        // An effect that is present in both recordings belongs to the rig; it does not describe a complete machine.
        let is_complete = self.diagnosed.diagnosis.since.is_none();
        value["found"] = json!(is_complete.then(|| Found::of(&self.diagnosed)).flatten());
        // Without the individual points.
        value["drift"] = self.drift.as_ref().map_or(
            Value::Null,
            |drift| json!({"verdict": drift.verdict, "drifts": drift.drifts, "reason": drift.reason}),
        );
        value["zero"] = json!(self.zero);
        if !self.sensors.is_empty() {
            value["sensors"] = json!(self.sensors);
        }
        Ok(value)
    }

    /// The page of the diagnosis. `recording`: its name for the title.
    ///
    /// # Errors
    /// [`SessionError::Json`]: none in practice.
    pub fn page(&self, machine: &str, recording: &str) -> Result<String, SessionError> {
        Ok(gap_page(machine, recording, &self.diagnosed)?)
    }
}

impl Session<'_> {
    /// Diagnoses one recording with candidate effects.
    ///
    /// # Errors
    /// [`SessionError::OtherMachine`] if the recording is not of the campaign's machine, [`SessionError::Gap`] if required data are missing or
    /// the nominal model cannot follow it.
    pub fn diagnose_gap(
        &self,
        recorded: &Recorded,
        campaign: &Campaign,
        map: &ChannelMap,
        effects: Vec<Arc<dyn Effect>>,
        healthy: Option<&Recorded>,
    ) -> Result<Gap, SessionError> {
        // The drift search runs first and takes about this share of the total time.
        let progress = |done_ratio: f64, what: &str| {
            self.send(SessionEvent::Progress { done_ratio, what: what.to_owned() });
        };
        progress(0.0, "drift");
        let GapInput { zeroed, model, linearised, drift, doubted, sensors } =
            self.prepare_for_gap(recorded, campaign, map)?;
        let ZeroedRecording { recording, declared, zero, off_at_rest } = zeroed;
        let before = healthy.map(|healthy| self.prepare_for_gap(healthy, campaign, map)).transpose()?;
        let between = |from: f64, to: f64| {
            move |done_ratio: f64, what: &str| progress(from + (to - from) * done_ratio, what)
        };
        let (in_catalogue, beyond) = (between(DRIFT_SHARE, CATALOGUE_END), between(CATALOGUE_END, 1.0));
        progress(DRIFT_SHARE, "steps that are allowed");
        let calibration = Calibration::shipped().map_err(SessionError::Calibration)?;
        let mut diagnosed = diagnose(GapRequest {
            recording: &recording,
            declared,
            healthy: before.as_ref().zip(healthy).map(|(before, healthy)| Healthy {
                name: healthy.path.display().to_string(),
                recording: &before.zeroed.recording,
                declared: before.zeroed.declared.clone(),
            }),
            tolerances_declared: campaign.tolerances_declared,
            experiments: experiments(self.registry, campaign, map, &model)?,
            model,
            effects,
            calibration: calibration.clone(),
            linearised,
            progress: &in_catalogue,
        })?;
        let discovery = discover(&diagnosed, &calibration, &beyond);
        progress(1.0, "done");
        if let Some(law) = discovery.settled {
            diagnosed.explain_by(law);
        }
        let diagnosis = &mut diagnosed.diagnosis;
        (diagnosis.closure_terms, diagnosis.residual_sources) =
            (discovery.closure_terms, discovery.residual_sources);
        if let Some(places) = discovery.places {
            diagnosis.r#where = places;
            // The best extra sensor is one next to the location that was just found.
            if matches!(diagnosis.next, Some(Next::Sensor { .. })) {
                diagnosis.next = Some(sensor_near(&diagnosis.r#where));
            }
        }
        let with_a_law = law_found(diagnosis).is_some();
        if let Some(Next::Sensor { reason, .. }) = &mut diagnosis.next
            && with_a_law
        {
            "the law needs confirmation: measure there, and add the law as an effect to the next diagnosis"
                .clone_into(reason);
        }
        let of_reader =
            |warning: &ReadWarning| GapWarning::RecordingIncomplete { reason: warning.to_string() };
        diagnosed.diagnosis.warnings.extend(recorded.read.warnings.iter().map(of_reader));
        diagnosed.diagnosis.off_at_rest = off_at_rest;
        note_drift(&mut diagnosed.diagnosis, drift.as_ref());
        let doubted = doubted.map(|reason| GapWarning::DriftNotSubtracted { reason });
        diagnosed.diagnosis.warnings.extend(doubted);
        Ok(Gap { diagnosed, drift, sensors, zero })
    }

    /// A recording prepared for the diagnosis: sensor drift and zero offsets are subtracted.
    fn prepare_for_gap(
        &self,
        recorded: &Recorded,
        campaign: &Campaign,
        map: &ChannelMap,
    ) -> Result<GapInput, SessionError> {
        check_machine(recorded, campaign)?;
        let mut model = nominal_model(campaign)?;
        // A recording that does not permit a drift search may still have a gap.
        let drift = self.drift(slice::from_ref(recorded), campaign, map).ok();
        let drift = drift.map(|drift| drift.report).filter(|report| !report.drifts.is_empty());
        let config = identification_with(campaign, map);
        let FusedRecordings { recordings, config, channels } =
            fuse_sensors(recordings(slice::from_ref(recorded)), config, Some(campaign), map);
        let sensors = channels.into_iter().next().unwrap_or_default();
        let raw = recordings.into_iter().next().unwrap_or_default();
        take_air_and_probe(&mut model, &config);
        let ready = |drift: Option<&DriftReport>| {
            let recording = subtract_drift(raw.clone(), drift);
            // The zero reduces the offset uncertainty.
            let settings = |soak: Soak| ZeroSettings { allows_a_fault: true, ..soak.into() };
            let zero = ZeroOutcome::of(&recording, &config, campaign.zero.map(settings));
            let off_at_rest = rest_offsets(&zero, &config.declared);
            let (recording, zeroed) = zero.subtract(recording, config.clone());
            let declared = Declared {
                sensors: zeroed.declared,
                noise_colour: map.noise_colour.unwrap_or_default(),
                tolerances: campaign.tolerances,
                nominal: campaign.boundary,
                common_offsets: zero.found().map_or_else(Vec::new, |zero| zero.common.clone()),
            };
            ZeroedRecording { recording, declared, zero, off_at_rest }
        };
        let as_it_is = ready(None);
        let linearised =
            drift.as_ref().and_then(|_| linearise_noise(&as_it_is, campaign, &model).ok().flatten());
        let (zeroed, drift, doubted) = match drift {
            Some(drift) if linearised.is_some() => (as_it_is, None, Some(drift.reason)),
            Some(drift) => (ready(Some(&drift)), Some(drift), None),
            None => (as_it_is, None, None),
        };
        Ok(GapInput { zeroed, model, linearised, drift, doubted, sensors })
    }

    /// Validates the machine found by a diagnosis against an independent recording. Nothing is fitted.
    ///
    /// # Errors
    /// As [`Session::diagnose_gap`], and [`SessionError::CalibratedModel`] if diagnosis and recording do not belong together.
    pub fn hold_twin(
        &self,
        recorded: &Recorded,
        campaign: &Campaign,
        map: &ChannelMap,
        effects: Vec<Arc<dyn Effect>>,
        found: &Found,
    ) -> Result<ForecastCheck, SessionError> {
        let GapInput { zeroed, model, .. } = self.prepare_for_gap(recorded, campaign, map)?;
        let ZeroedRecording { recording, declared, .. } = zeroed;
        let (study, _) = checked_study(&recording, declared, model, effects, campaign.tolerances_declared)?;
        Ok(check_forecast(&study, found)?)
    }

    /// Expected readings of the diagnosed machine at the end of each planned step of a campaign.
    ///
    /// # Errors
    /// [`SessionError`] if no plan can be made, or the calibrated model cannot follow it.
    pub fn forecast_twin(
        &self,
        campaign: &Campaign,
        map: &ChannelMap,
        effects: Vec<Arc<dyn Effect>>,
        found: &Found,
    ) -> Result<Vec<Expected>, SessionError> {
        let model = nominal_model(campaign)?;
        let plan = plan(campaign, &model)?;
        let sensors = identification_with(campaign, map).declared;
        let lag = Response::lag(campaign.tolerances.actuator_lag_s);
        let like = SimulatedRig {
            channels: sensors.keys().copied().collect(),
            declared: Declared {
                sensors,
                noise_colour: map.noise_colour.unwrap_or_default(),
                tolerances: campaign.tolerances,
                nominal: campaign.boundary,
                common_offsets: Vec::new(),
            },
            model,
            effects,
            actuators: Actuators { p3: lag, valve: Response::lag(0.0), judged: campaign.tolerances_declared },
        };
        let steps = plan.steps.iter().map(|step| StepMarker {
            index: step.index,
            kind: step.kind,
            start_s: step.start_s,
            end_s: step.start_s + step.dwell_s,
            from: step.from,
            to: Some(step.to),
            p3_pa: step.p3_pa,
            valve_opening_ratio: step.to.valve_opening_ratio,
        });
        Ok(forecast_steps(like, steps.collect(), found)?)
    }
}

/// The linearised recording if tolerances alone explain it down to noise. In that case apparent drift in repeats is not subtracted, because the
/// diagnosis is much more sensitive.
fn linearise_noise(
    zeroed: &ZeroedRecording,
    campaign: &Campaign,
    model: &Model,
) -> Result<Option<Linearised>, GapError> {
    let (declared, judged) = (zeroed.declared.clone(), campaign.tolerances_declared);
    let (study, _) = checked_study(&zeroed.recording, declared, model.clone(), Vec::new(), judged)?;
    let linearised = Linearised::new(&study)?;
    let null = fit(&study, &linearised, &study.nothing(), &Selection::all(&study), Effort::default())?;
    let misfit = adequacy(&study, &linearised, &null);
    let noise = Calibration::shipped().is_ok_and(|calibration| calibration.outside(misfit.features()) < 0.5);
    Ok(noise.then_some(linearised))
}

/// A recording with its zero subtracted.
struct ZeroedRecording {
    recording: Recording,
    declared: Declared,
    zero: ZeroOutcome,
    /// Remarks of the zero on sensors with offsets beyond their declaration.
    off_at_rest: Vec<OffsetAtRest>,
}

/// A recording prepared for the diagnosis.
struct GapInput {
    zeroed: ZeroedRecording,
    model: Model,
    /// The recording linearised at the nominal model, if that is known.
    linearised: Option<Linearised>,
    drift: Option<DriftReport>,
    /// A detected drift that was rejected.
    doubted: Option<String>,
    sensors: Vec<FusedChannel>,
}

/// Zero offset, in declared standard deviations, above which a sensor is reported.
const BEYOND_SIGMAS: f64 = 3.0;

/// The sensors whose zero offset exceeds their declaration.
fn rest_offsets(zero: &ZeroOutcome, declared: &BTreeMap<Channel, DeclaredUncertainty>) -> Vec<OffsetAtRest> {
    let ZeroOutcome::Found(zero) = zero else { return Vec::new() };
    let beyond = zero.offsets.iter().filter_map(|(channel, offset)| {
        let declared_sigma = declared.get(channel).map_or(0.0, |declared| declared.offset_sigma);
        let residual_offset = zero.left_sigma.get(channel).copied().unwrap_or(0.0);
        (offset.abs() > BEYOND_SIGMAS * declared_sigma.hypot(residual_offset)).then_some(OffsetAtRest {
            channel: *channel,
            offset: *offset,
            declared_sigma,
        })
    });
    beyond.collect()
}

/// Share of the time taken by the drift search.
const DRIFT_SHARE: f64 = 0.15;
/// Share of the time after which the effect library is finished and the search for unmodelled effects begins.
const CATALOGUE_END: f64 = 0.7;

/// The recording for the diagnosis, with sensor drift subtracted.
pub(crate) fn subtract_drift(recording: Recording, drift: Option<&DriftReport>) -> Recording {
    drift.and_then(|drift| without_drift(&recording, drift)).unwrap_or(recording)
}

/// After drift subtraction, unmodelled causes below this probability are ignored. The uncertainty of the drift's time history is not in any
/// tolerance, and its residual resembles a small unmodelled cause.
const SURELY_OUTSIDE: f64 = 0.9;

/// Adds the drift to the diagnosis, which does not name a cause for it.
fn note_drift(diagnosis: &mut Diagnosis, drift: Option<&DriftReport>) {
    let Some(drift) = drift else { return };
    let subtracted = drift.drifts.iter().all(|drift| drift.cause.kind() == CauseKind::Sensor);
    diagnosis.warnings.insert(0, GapWarning::Drift { reason: drift.reason.clone(), subtracted });
    if subtracted
        && diagnosis.verdict == Verdict::Unexplained
        && diagnosis.probability_outside < SURELY_OUTSIDE
    {
        diagnosis.verdict = Verdict::WithinTolerance;
        diagnosis.r#where.clear();
        diagnosis.residual_sources.clear();
        diagnosis.next = None;
        diagnosis.experiments.clear();
    }
    // A change with time cannot be expressed as a closure term.
    diagnosis.closure_terms.clear();
    if !subtracted && matches!(diagnosis.verdict, Verdict::Explained | Verdict::PartlyExplained) {
        diagnosis.verdict = Verdict::Unexplained;
        diagnosis.experiments.clear();
        diagnosis.next.get_or_insert_with(|| sensor_near(&diagnosis.r#where));
    }
}
