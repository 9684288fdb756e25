//! Converts a recording into identified points, with their truth if known. All commands use this module.

use crate::plan::planning::find_surge_marks;
use crate::recording::files::POINTS_FORMAT;
use crate::recording::fusing::{fuse_sensors, take_air_and_probe};
use crate::recording::identification_config::{
    declared_conditions, identification_of, identification_with, warn_about_calibrations,
};
use crate::recording::recording_file::{Recorded, check_all_distinct, check_machine};
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::campaign::Date;
use mapper_campaign::{Campaign, nominal_model};
use mapper_core::{
    Channel, CompressorMap, EventKind, IdentifiedPoint, JsonMessages, Method, PointBudgets, Recording,
    ResultRemark, StepMarker, StepOrigin, ThermalModel, TurbineHousing, TurbineMap, TurbinePoint,
    join_recordings,
};
use mapper_diagnose::gap::PointCorrection;
use mapper_identify::{
    BladeCount, CellReference, DynamicEfficiency, FittedReadings, FoundFault, IdentifyConfig, IsothermalZero,
    NominalRig, PeriodicError, ZeroOutcome, ZeroSettings, blade_count, identify_recording, isothermal_zero,
    method_for, with_measured_humidity,
};
use mapper_maps::{AssembleError, RepeatedJump, assemble, identified_turbine_map, repeated_jumps};
use mapper_observe::FusedChannel;
use mapper_observe::declared::CommonOffset;
use mapper_observe::energy_balance::Gases;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::wheel::WheelCoefficients;
use mapper_recording::score::{
    PendingTruths, ScoreSummary, ScoredPoint, ScoredTurbinePoint, Truth, score, score_marks, score_turbine,
    with_truths,
};
use mapper_recording::{AmbientPressure, Barometer, ChannelMap};
use mapper_report::{Message, PointResults, SurgeReport, wheel_coefficients};
use mapper_runner::surge::SurgeMarks;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Minimum soak before the first step, s, that triggers a remark. Thermocouples in a housing need this time to equalise.
const UNUSED_REST_S: f64 = 600.0;

/// Identification result of a recording.
#[derive(Debug, Clone, Serialize)]
pub struct Identified {
    /// The identified recording: joined from several files, with fused sensors and the isothermal zero subtracted.
    #[serde(skip)]
    pub recording: Recording,
    /// Origin of each of its steps.
    #[serde(skip)]
    pub origins: Vec<StepOrigin>,
    /// The identification settings.
    #[serde(skip)]
    pub config: IdentifyConfig,
    /// The points, with the truth if the recording contains it.
    pub points: Vec<ScoredPoint>,
    /// The turbine at the points whose turbine side was measured, with the truth.
    pub turbine: Vec<ScoredTurbinePoint>,
    /// The heat balance of the turbine housing.
    pub turbine_housing: Option<TurbineHousing>,
    /// Parameters common to all points (joint method).
    pub thermal: Option<ThermalModel>,
    /// Results of the dynamic method for the same steps (joint method).
    pub dynamic: Vec<DynamicEfficiency>,
    /// Faults of sensors or machine that are needed to explain the recording.
    #[serde(skip)]
    pub faults: Vec<FoundFault>,
    /// Uncertainty budgets of the points, in order.
    #[serde(skip)]
    pub budgets: Vec<PointBudgets>,
    /// Each step, by its index, with the readings that the fit predicts.
    #[serde(skip)]
    pub fitted: Vec<(usize, Vec<FittedReadings>)>,
    /// Result of sensor fusion.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<FusedChannel>,
    /// Result of the zero.
    pub zero: ZeroOutcome,
    /// Errors of the points against the truth; `None` on a real rig.
    pub score: Option<ScoreSummary>,
    /// Surge-side limits of the map; `None` if there was no search.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surge: Option<SurgeReport>,
    /// Efficiencies before and after a correction for the causes of a gap; empty without one.
    #[serde(skip)]
    pub corrections: Vec<PointCorrection>,
    /// Other remarks.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ResultRemark>,
}

#[derive(Debug, Serialize)]
struct WheelStep {
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    step: usize,
    #[serde(flatten)]
    coefficients: WheelCoefficients,
}

impl Identified {
    /// Machine-readable output. `recording`: the first file; `warnings`: the reader's warnings.
    pub fn json(&self, recording: Option<&Path>, warnings: &[String]) -> Value {
        let mut value = self.points_json();
        value["recording"] = json!(recording);
        value["score"] = json!(self.score);
        value["recording_warnings"] = json!(warnings);
        value["remarks"] = json!(JsonMessages(&self.remarks));
        value
    }

    pub(crate) fn points_json(&self) -> Value {
        let mut value = json!({
            "format_version": POINTS_FORMAT,
            "reference": self.config.reference,
            "efficiency": self.config.air.efficiency,
            "gas": self.config.air.description(),
            "points": self.points,
            "turbine": self.turbine,
            "turbine_housing": self.turbine_housing,
            "thermal": self.thermal,
            "dynamic": self.dynamic,
            "faults": self.faults,
            "budgets": self.budgets,
            "zero": self.zero,
        });
        if !self.sensors.is_empty() {
            value["sensors"] = json!(self.sensors);
        }
        if let Some(surge) = &self.surge {
            value["surge"] = json!(surge);
        }
        if let Some(wheel_diameter_m) = self.config.wheel_diameter_m {
            let wheel = |point: &IdentifiedPoint| WheelStep {
                step: point.step,
                coefficients: wheel_coefficients(point, wheel_diameter_m, self.config.air),
            };
            value["wheel"] = json!(self.points_alone().map(wheel).collect::<Vec<_>>());
        }
        value
    }

    /// The results for people. `remarks`: these, and further ones.
    pub fn shown<'a>(
        &'a self,
        map: Option<&'a CompressorMap>,
        repeats: &'a [RepeatedJump],
        remarks: &'a [ResultRemark],
    ) -> PointResults<'a> {
        PointResults {
            points: &self.points,
            map,
            dynamic: &self.dynamic,
            repeats,
            thermal: self.thermal.as_ref(),
            zero: &self.zero,
            sensors: &self.sensors,
            surge: self.surge.as_ref(),
            turbine: &self.turbine,
            remarks,
        }
    }

    pub(crate) fn gases(&self) -> Gases {
        Gases { compressor: self.config.air, turbine: self.config.turbine_gas }
    }

    /// The points without their truth.
    pub fn points_alone(&self) -> impl Iterator<Item = &IdentifiedPoint> {
        self.points.iter().map(|scored| &scored.point)
    }

    /// Checks that there is at least one point.
    pub fn has_points(&self, warnings: &[String]) -> Result<(), SessionError> {
        let why: Vec<String> =
            warnings.iter().cloned().chain(self.remarks.iter().map(Message::message)).collect();
        if self.points.is_empty() { Err(SessionError::NoPoints(why.join("; "))) } else { Ok(()) }
    }

    /// The map of the points with map coordinates: the others are left out.
    pub(crate) fn map(&self, machine: &str) -> Result<CompressorMap, AssembleError> {
        let has_place = |point: &&IdentifiedPoint| {
            let place = [point.flow_corrected_kg_s, point.pressure_ratio, point.speed_corrected_rpm];
            place.iter().all(|value| value.is_finite())
        };
        let points: Vec<IdentifiedPoint> = self.points_alone().filter(has_place).cloned().collect();
        let config = &self.config;
        let map = assemble(&points, machine, config.reference, config.method)?;
        let surge = self.surge.iter().flat_map(|found| found.marks.iter().map(|scored| scored.mark));
        let wheel_diameter_m = config.wheel_diameter_m;
        Ok(CompressorMap { wheel_diameter_m, surge: surge.collect(), ..with_gas(map, config.air) })
    }

    /// The map of the turbine; `None` with too few points.
    pub fn turbine_map(&self, machine: &str) -> Option<TurbineMap> {
        let points: Vec<&TurbinePoint> = self.turbine.iter().map(|scored| &scored.point).collect();
        identified_turbine_map(machine, &points).ok()
    }

    /// Jumps that were repeated.
    pub fn repeats(&self) -> Vec<RepeatedJump> {
        let points: Vec<IdentifiedPoint> = self.points_alone().cloned().collect();
        repeated_jumps(&self.recording.steps, &points)
    }
}

pub(crate) fn with_gas(map: CompressorMap, air: Air) -> CompressorMap {
    CompressorMap { efficiency: Some(air.efficiency), gas: Some(air.description()), ..map }
}

impl Session<'_> {
    /// Identifies all steps of recordings of one machine together. The first gives campaign, sensors, window and zero, else the channel map.
    pub fn identify(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        method: Option<Method>,
    ) -> Result<Identified, SessionError> {
        let candidates = recorded.iter().filter(|part| may_have_truth(part));
        let paths: Vec<PathBuf> = candidates.map(|part| part.path.clone()).collect();
        with_truths(&paths, |truths| self.identify_and_score(recorded, map, method, truths))
    }

    /// Same as [`identify`](Session::identify), and compares with the truths in the recordings.
    fn identify_and_score(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        method: Option<Method>,
        truths: PendingTruths<'_>,
    ) -> Result<Identified, SessionError> {
        let campaign = same_campaign(&recorded)?.cloned();
        check_all_distinct(&recorded)?;
        let campaign = campaign.as_ref();
        let mut config = match (campaign, &map.machine) {
            (Some(campaign), _) => identification_with(campaign, map),
            (None, Some(machine)) => identification_of(machine, map),
            (None, None) => {
                return Err(SessionError::MachineUnknown { channel_map_suffices: true });
            }
        };
        let mut remarks = Vec::new();
        config.method = method.unwrap_or_else(|| {
            let configured_method = config.method;
            let choices = recorded.iter().map(|part| method_for(&part.read.recording, configured_method));
            let (method, why) =
                choices.reduce(|a, b| if a.1.is_some() { a } else { b }).unwrap_or((configured_method, None));
            remarks.extend(why);
            method
        });
        let parameters = config.joint.held_fixed();
        if config.method == Method::Joint && !parameters.is_empty() {
            remarks.push(ResultRemark::HeldFixed { parameters });
        }
        remarks.extend(unknown_barometer(map));
        let day = recorded.first().and_then(|first| Date::from_epoch_ns(first.read.start_time_ns));
        let soak = campaign.and_then(|campaign| campaign.zero);
        let (mut recordings, mut sources) = (Vec::new(), Vec::new());
        for part in recorded {
            let may_have_truth = may_have_truth(&part);
            let Recorded { read, approaches, .. } = part;
            sources.push(Source { steps: read.recording.steps.clone(), approaches, may_have_truth });
            recordings.push(read.recording);
        }
        let fused = fuse_sensors(recordings, config, campaign, map);
        let sensors = fused.channels.into_iter().next().unwrap_or_default();
        let first = fused.recordings.first().ok_or(SessionError::NoRecording)?;
        // A script may zero without a soak of the campaign.
        let is_zeroed = first.events.iter().any(|event| event.kind == EventKind::SoakEnded);
        let settings = soak.map(Into::into).or_else(|| is_zeroed.then(ZeroSettings::default));
        let zero = ZeroOutcome::of(first, &fused.config, settings);
        remarks
            .extend(campaign.filter(|_| settings.is_none()).and_then(|_| unused_rest(first, &fused.config)));
        remarks.extend(zero.found().into_iter().flat_map(contradictions));
        let periodic = zero.found().map_or(&[][..], |zero| zero.periodic.as_slice());
        remarks.extend(periodic.iter().map(|&PeriodicError { channel, period_s, amplitude }| {
            ResultRemark::PeriodicError { channel, period_s, amplitude }
        }));
        let (_, config) = zero.subtract(Recording::default(), fused.config.clone());
        let off = |recording: Recording| zero.subtract(recording, fused.config.clone()).0;
        let (recording, origins) = join_recordings(fused.recordings.into_iter().map(off).collect());
        let config = with_measured_humidity(&recording, &config);
        let declared = campaign.filter(|campaign| campaign.tolerances_declared);
        let mut model = match declared {
            Some(campaign) => Some(nominal_model(campaign)?),
            // It only shows the scale of the speeds.
            None => campaign.and_then(|campaign| nominal_model(campaign).ok()),
        };
        model.iter_mut().for_each(|model| take_air_and_probe(model, &config));
        let nominal = declared.zip(model.as_ref());
        let conditions = campaign.map(declared_conditions).unwrap_or_default();
        let nominal = nominal.map(|(campaign, model)| NominalRig {
            model,
            tolerances: &campaign.tolerances,
            conditions: &conditions,
        });
        let identified = identify_recording(&recording, &config, nominal)?;
        let mut points: Vec<IdentifiedPoint> = identified.points.into_iter().filter_map(Result::ok).collect();
        if let Some(campaign) = campaign {
            let grid_rpm: Vec<f64> = campaign.points.iter().map(|point| point.speed_rpm).collect();
            let map = model.as_ref().map(|model| model.map.as_ref());
            let count = blade_count(&points, config.reference, &grid_rpm, map);
            remarks.extend(count.map(|BladeCount { blades, set }| ResultRemark::BladeCount { blades, set }));
            warn_about_calibrations(&mut points, &recording, campaign, day);
        }
        for point in &points {
            self.send(SessionEvent::PointIdentified(Box::new(point.clone())));
        }
        let mut candidates = truths.wait()?.into_iter();
        let truth =
            |source: &Source| source.may_have_truth.then(|| candidates.next()).flatten().unwrap_or_default();
        let truths: Vec<Truth> = sources.iter().map(truth).collect();
        let surge = collect_surge_marks(&sources, &truths, off, campaign, &config);
        let points = score_by_source(
            &sources,
            &truths,
            (&recording, &origins),
            points,
            |point| &mut point.step,
            score,
            |scored| &mut scored.point.step,
        );
        let turbine = score_by_source(
            &sources,
            &truths,
            (&recording, &origins),
            identified.turbine,
            |point| &mut point.step,
            score_turbine,
            |scored| &mut scored.point.step,
        );
        let score = mapper_recording::score::summarise(&points);
        Ok(Identified {
            recording,
            origins,
            config,
            points,
            turbine,
            turbine_housing: identified.turbine_housing,
            thermal: identified.thermal,
            dynamic: identified.dynamic,
            faults: identified.faults,
            budgets: identified.budgets,
            fitted: identified.fitted,
            sensors,
            zero,
            score,
            surge,
            corrections: Vec::new(),
            remarks,
        })
    }
}

fn contradictions(zero: &IsothermalZero) -> impl Iterator<Item = ResultRemark> + '_ {
    let contradicting = zero.references.iter().filter(|reference| reference.contradiction().is_some());
    contradicting.filter_map(|reference| {
        let is_of_kind = |common: &&CommonOffset| {
            common.channels.first().is_some_and(|channel| channel.info().dimension == reference.dimension)
        };
        let channel = *zero.common.iter().find(is_of_kind)?.channels.first()?;
        let CellReference { reading, reference, common_sigma, .. } = *reference;
        Some(ResultRemark::CellContradicts { channel, reading, reference, common_sigma })
    })
}

fn unknown_barometer(map: &ChannelMap) -> Option<ResultRemark> {
    let unknown = Barometer::unknown();
    let used = [Channel::P1, Channel::P2].into_iter().any(|channel| map.is_gauge(channel));
    (used && map.ambient_pressure == Some(AmbientPressure::Constant(unknown))).then_some(
        ResultRemark::UnknownAmbientPressure { pressure_pa: unknown.pressure_pa, sigma_pa: unknown.sigma_pa },
    )
}

fn unused_rest(recording: &Recording, config: &IdentifyConfig) -> Option<ResultRemark> {
    let settings = ZeroSettings { shortest_s: UNUSED_REST_S, ..ZeroSettings::default() };
    let rest = isothermal_zero(recording, config, &settings).ok().filter(|rest| !rest.offsets.is_empty())?;
    Some(ResultRemark::UnusedRest { start_s: rest.start_s, end_s: rest.end_s })
}

struct Source {
    steps: Vec<StepMarker>,
    approaches: Option<Recording>,
    may_have_truth: bool,
}

fn same_campaign(recorded: &[Recorded]) -> Result<Option<&Campaign>, SessionError> {
    let first = recorded.first().ok_or(SessionError::NoRecording)?;
    let Some(campaign) = &first.campaign else { return Ok(None) };
    for other in recorded {
        check_machine(other, campaign)?;
        let Some(theirs) = &other.campaign else { continue };
        let differs = if theirs.machine != campaign.machine {
            "machine"
        } else if theirs.sensors != campaign.sensors {
            "sensors"
        } else if theirs.reference != campaign.reference {
            "reference state"
        } else {
            continue;
        };
        let (first, other) = (first.path.clone(), other.path.clone());
        return Err(SessionError::DifferentCampaigns { first, other, differs });
    }
    Ok(Some(campaign))
}

fn may_have_truth(recorded: &Recorded) -> bool {
    recorded.read.format.is_some()
}

/// Points with their truth, each from its own recording, in which steps have other numbers than in all together.
fn score_by_source<P: Clone, S>(
    sources: &[Source],
    truths: &[Truth],
    (recording, origins): (&Recording, &[StepOrigin]),
    points: Vec<P>,
    step_of: impl Fn(&mut P) -> &mut usize,
    score: impl Fn(&Truth, &[StepMarker], Vec<P>) -> Vec<S>,
    step_of_scored: impl Fn(&mut S) -> &mut usize,
) -> Vec<S> {
    let origin_of = |index: usize| {
        let position = recording.steps.iter().position(|step| step.index == index)?;
        origins.get(position)
    };
    let mut all: Vec<(usize, S)> = Vec::new();
    for (number, (source, truth)) in sources.iter().zip(truths).enumerate() {
        let (mut places, mut alone) = (Vec::new(), Vec::new());
        for (place, point) in points.iter().enumerate() {
            let mut point = point.clone();
            let step = step_of(&mut point);
            let together = *step;
            let Some(origin) = origin_of(together).filter(|origin| origin.recording == number) else {
                continue;
            };
            *step = origin.step;
            places.push((place, together));
            alone.push(point);
        }
        let scored = score(truth, &source.steps, alone);
        all.extend(places.into_iter().zip(scored).map(|((place, together), mut point)| {
            *step_of_scored(&mut point) = together;
            (place, point)
        }));
    }
    all.sort_by_key(|(place, _)| *place);
    all.into_iter().map(|(_, point)| point).collect()
}

/// The marks of all approaches with their truth; `None` if there was no surge search.
fn collect_surge_marks(
    sources: &[Source],
    truths: &[Truth],
    off: impl Fn(Recording) -> Recording,
    campaign: Option<&Campaign>,
    config: &IdentifyConfig,
) -> Option<SurgeReport> {
    let mut all: Option<SurgeReport> = None;
    for (Source { approaches, .. }, truth) in sources.iter().zip(truths) {
        let Some(approaches) = approaches.clone().map(&off) else { continue };
        let SurgeMarks { marks, remarks, surges } = find_surge_marks(&approaches, campaign, config);
        let marks = score_marks(truth, &approaches, config.reference, marks);
        let together = all.get_or_insert_with(SurgeReport::default);
        together.marks.extend(marks);
        together.remarks.extend(remarks);
        together.surges += surges;
    }
    if let Some(all) = &mut all {
        all.marks.sort_by(|a, b| a.mark.speed_corrected_rpm.total_cmp(&b.mark.speed_corrected_rpm));
    }
    all
}
