//! Runs of a case on the virtual lab: its schedule, steps, and where samples go.

use crate::blind::cases::{BlindError, Case, Laboratory, Truth, TruthPoint};
use mapper_backends::other_lab;
use mapper_backends::other_lab::OtherStructure;
use mapper_backends::virtual_lab::{
    ActuatorDynamics, LabSettings, SensorErrors, Start, VirtualLab, Weather, draw_tolerances,
};
use mapper_campaign::Campaign;
use mapper_core::{
    Channel, NoiseColour, OperatingPoint, PlanStep, Predicted, Recording, SampleBatch, StepKind, StepMarker,
    UnpacedClock,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect;
use mapper_physics::rig::effect::Rig;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady;
use mapper_recording::{ChannelMap, RecordError, RecordingHeader, RecordingWriter, StepPhase};
use mapper_runner::{ObserverError, RunObserver, Runner, StepSource, StepSourceError};
use mapper_session::declared;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Data that all cases of a campaign share: its points with the P3 that the nominal model needs for them.
pub(crate) struct Schedule<'a> {
    campaign: &'a Campaign,
    nominal: &'a Model,
    steps: Vec<PlanStep>,
    laboratory: Laboratory,
}

/// Converts the seed of a case into the seed of its reference recording; no other draw uses it.
const REFERENCE_NIGHT: u64 = 0x3C6E_F372_FE94_F82B;

impl<'a> Schedule<'a> {
    /// The points in the campaign's own order, P3 commanded open loop.
    pub(crate) fn new(campaign: &'a Campaign, nominal: &'a Model) -> Result<Self, BlindError> {
        Ok(Schedule {
            campaign,
            nominal,
            steps: steps_of_case(campaign, nominal)?,
            laboratory: Laboratory::default(),
        })
    }

    pub(crate) fn on(self, laboratory: Laboratory) -> Self {
        Schedule { laboratory, ..self }
    }

    /// The lab of a case: the nominal machine with random tolerances and the causes; `night_seed` determines noise and weather.
    fn lab(&self, case: &Case, night_seed: u64) -> Result<VirtualLab, BlindError> {
        let mut rig = Rig::new(self.nominal.clone());
        draw_tolerances(&mut rig, &self.campaign.tolerances, case.seed);
        for cause in &case.causes {
            effect::add(&mut rig, cause.effect.as_ref(), &cause.values)?;
        }
        let immediate = ActuatorDynamics::AT_ONCE;
        let p3_actuator = ActuatorDynamics::new(self.campaign.tolerances.actuator_lag_s, f64::INFINITY);
        let mut settings = LabSettings {
            start: Start::Settled,
            p3_actuator,
            t3_actuator: immediate,
            valve_actuator: immediate,
            oil_actuator: immediate,
            weather: Weather::draw(night_seed),
            seed: night_seed,
            ..LabSettings::ideal(self.nominal.clone(), self.campaign.boundary)
        };
        settings.take(rig);
        settings.sensors = self.sensors(case.seed);
        match self.laboratory {
            Laboratory::VirtualLab => {}
            Laboratory::OtherLab => other_lab::apply_structure(&mut settings, OtherStructure::default()),
            Laboratory::TwoMasses => other_lab::apply_structure(&mut settings, OtherStructure::two_masses()),
        }
        Ok(VirtualLab::new(settings))
    }

    fn sensors(&self, seed: u64) -> std::collections::BTreeMap<Channel, SensorErrors> {
        let colour = NoiseColour::default();
        let white_share = (1.0 - colour.first_order_share_ratio.powi(2)).sqrt();
        // A random stream that no other part of the lab uses.
        let mut random = Pcg64::seed_from_u64(seed ^ 0x5851_F42D_4C95_7F2D);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        declared(self.campaign, &ChannelMap::native())
            .into_iter()
            .map(|(channel, declared)| {
                let errors = SensorErrors {
                    white_sigma: white_share * declared.noise_sigma,
                    coloured_sigma: colour.first_order_share_ratio * declared.noise_sigma,
                    coloured_time_constant_s: colour.time_constant_s,
                    offset: declared.offset_sigma * normal(),
                    gain_ratio: declared.gain_sigma_ratio * normal(),
                    exact_reading: -channel.gain_distance(0.0),
                };
                (channel, errors)
            })
            .collect()
    }

    pub(crate) fn run(
        &self,
        case: &Case,
        file: &Path,
        header: &RecordingHeader,
    ) -> Result<Truth, BlindError> {
        let mut destination = FileDestination::new(RecordingWriter::create(file, header)?);
        self.drive(case, case.seed, &mut destination)?;
        Ok(Truth::new(case, destination.finish()?))
    }

    /// Runs the rig of a case without its causes on another night: the same offsets and tolerances, other noise and weather.
    pub(crate) fn run_reference(
        &self,
        case: &Case,
        file: &Path,
        header: &RecordingHeader,
    ) -> Result<(), BlindError> {
        let mut destination = FileDestination::new(RecordingWriter::create(file, header)?);
        let without_causes = Case { causes: Vec::new(), sigmas: Vec::new(), ..case.clone() };
        self.drive(&without_causes, case.seed ^ REFERENCE_NIGHT, &mut destination)?;
        destination.finish()?;
        Ok(())
    }

    pub(crate) fn record(&self, case: &Case) -> Result<Recording, BlindError> {
        let mut destination = MemoryDestination::default();
        self.drive(case, case.seed, &mut destination)?;
        Ok(destination.recording)
    }

    /// Uses the runner of all campaigns without guards, because a virtual machine cannot be damaged.
    fn drive(&self, case: &Case, night_seed: u64, observer: &mut dyn RunObserver) -> Result<(), BlindError> {
        let runner = Runner {
            steps: &mut StepsOfCase { left: self.steps.iter(), warm_up_s: self.campaign.timing.warm_up_s },
            backend: &mut self.lab(case, night_seed)?,
            clock: &mut UnpacedClock,
            guards: Vec::new(),
            observer,
            // No speed control: the effect of the causes on the speed is part of their signature.
            speed: None,
            stop: &AtomicBool::new(false),
        };
        let of_case = |source| BlindError::Run { name: case.name.clone(), source };
        runner.run().map(|_| ()).map_err(of_case)
    }
}

/// Writes the recording, and collects the truth at the end of each step for the answers.
pub(crate) struct FileDestination {
    writer: RecordingWriter,
    last: SampleBatch,
    points: Vec<TruthPoint>,
}

impl FileDestination {
    pub(crate) fn new(writer: RecordingWriter) -> Self {
        FileDestination { writer, last: SampleBatch::default(), points: Vec::new() }
    }

    pub(crate) fn finish(self) -> Result<Vec<TruthPoint>, RecordError> {
        self.writer.finish()?;
        Ok(self.points)
    }
}

impl RunObserver for FileDestination {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::Start).map_err(ObserverError::new)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let without_truth = SampleBatch { truth: Vec::new(), ..batch.clone() };
        self.writer.write_batch(&without_truth).map_err(ObserverError::new)?;
        self.last = batch.clone();
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let last = |name: &str| {
            let column = self.last.truth.iter().find(|column| column.name == name);
            column.and_then(|column| column.values.last().copied()).unwrap_or(f64::NAN)
        };
        self.points.push(TruthPoint {
            valve: marker.valve_opening_ratio,
            speed_rpm: last("speed_rpm"),
            eta: last("eta"),
            h: last("h_w_m2k"),
        });
        self.writer.write_step(marker, StepPhase::End).map_err(ObserverError::new)
    }
}

#[derive(Default)]
pub(crate) struct MemoryDestination {
    pub(crate) recording: Recording,
}

impl RunObserver for MemoryDestination {
    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        for column in &batch.columns {
            let series = self.recording.series.entry(column.channel).or_default();
            series.t_s.extend(&batch.t_s);
            series.values.extend(&column.values);
        }
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.recording.steps.push(*marker);
        Ok(())
    }
}

/// One step for each point with the P3 that the nominal model needs. Only the steady state is predicted.
pub(crate) fn steps_of_case(campaign: &Campaign, nominal: &Model) -> Result<Vec<PlanStep>, BlindError> {
    let (timing, dwell_s) = (&campaign.timing, campaign.timing.dwell.fixed_or_usual_s());
    let mut from: Option<OperatingPoint> = None;
    let points = campaign.points.iter().enumerate();
    points
        .map(|(index, point)| {
            let boundary =
                BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
            let steady_state = steady::hold_speed(nominal, point.speed_rpm, &boundary)?;
            let outputs = &steady_state.outputs;
            Ok(PlanStep {
                index,
                kind: StepKind::Point,
                from: from.replace(*point),
                to: *point,
                p3_pa: steady_state.boundary.p3_pa,
                t3_k: boundary.t3_k,
                oil_temperature_k: boundary.oil_temperature_k,
                dwell_s,
                start_s: timing.warm_up_s + index as f64 * dwell_s,
                transition: None,
                predicted: Predicted::settled(
                    outputs.flow_kg_s,
                    outputs.pressure_ratio,
                    outputs.t2_k,
                    dwell_s,
                ),
            })
        })
        .collect()
}

pub(crate) struct StepsOfCase<'a> {
    left: std::slice::Iter<'a, PlanStep>,
    warm_up_s: f64,
}

impl StepSource for StepsOfCase<'_> {
    fn warm_up_s(&self) -> f64 {
        self.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        0.0
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        Ok(self.left.next().cloned())
    }
}
