//! Runs one case on the virtual lab.

use crate::case::Case;
use crate::error::BlindError;
use crate::truth::Truth;
use crate::truth::TruthPoint;
use mapper_backends::virtual_lab::{
    ActuatorDynamics, LabSettings, SensorErrors, Start, VirtualLab, Weather, draw_tolerances,
};
use mapper_campaign::Campaign;
use mapper_core::{
    Backend, Channel, NoiseColour, OperatingPoint, Recording, RigMode, SampleBatch, Setpoints, StepKind,
    StepMarker,
};
use mapper_physics::effect::{self, Rig};
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady;
use mapper_record::{RecordingHeader, RecordingWriter, StepPhase};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::path::Path;

/// What all cases of a campaign share: its points with the P3 that the nominal model needs for them.
pub(crate) struct Schedule<'a> {
    campaign: &'a Campaign,
    nominal: &'a Model,
    points: Vec<(OperatingPoint, Setpoints)>,
}

impl<'a> Schedule<'a> {
    /// The points in the campaign's own order, P3 commanded open loop.
    pub(crate) fn new(campaign: &'a Campaign, nominal: &'a Model) -> Result<Self, BlindError> {
        let points = campaign
            .points
            .iter()
            .map(|point| {
                let boundary = BoundaryConditions {
                    valve_opening_ratio: point.valve_opening_ratio,
                    ..campaign.boundary
                };
                let held = steady::hold_speed(nominal, point.speed_rpm, &boundary)?;
                let setpoints = Setpoints {
                    mode: RigMode::Running,
                    p3_pa: held.boundary.p3_pa,
                    t3_k: boundary.t3_k,
                    valve_opening_ratio: point.valve_opening_ratio,
                    oil_temperature_k: boundary.oil_temperature_k,
                };
                Ok((*point, setpoints))
            })
            .collect::<Result<_, BlindError>>()?;
        Ok(Schedule { campaign, nominal, points })
    }

    /// The lab of a case: nominal machine, drawn tolerances, then the causes.
    fn lab(&self, case: &Case) -> Result<VirtualLab, BlindError> {
        let mut rig = Rig::new(self.nominal.clone());
        draw_tolerances(&mut rig, &self.campaign.tolerances, case.seed);
        for cause in &case.causes {
            effect::add(&mut rig, cause.effect.as_ref(), &cause.values)?;
        }
        let at_once = ActuatorDynamics { lag_s: 0.0, slew_per_s: f64::INFINITY };
        let p3_actuator =
            ActuatorDynamics { lag_s: self.campaign.tolerances.actuator_lag_s, slew_per_s: f64::INFINITY };
        let mut settings = LabSettings {
            start: Start::Settled,
            p3_actuator,
            t3_actuator: at_once,
            valve_actuator: at_once,
            oil_actuator: at_once,
            weather: Weather::drawn(case.seed),
            seed: case.seed,
            ..LabSettings::ideal(self.nominal.clone(), self.campaign.boundary)
        };
        settings.take(rig);
        settings.sensors = self.sensors(case.seed);
        Ok(VirtualLab::new(settings))
    }

    /// Noise and drawn offsets as declared.
    fn sensors(&self, seed: u64) -> std::collections::BTreeMap<Channel, SensorErrors> {
        let colour = NoiseColour::default();
        let white_share = (1.0 - colour.first_order_share_ratio.powi(2)).sqrt();
        // A stream that nothing else of the lab uses.
        let mut random = Pcg64::seed_from_u64(seed ^ 0x5851_F42D_4C95_7F2D);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let sensors = self.campaign.sensors.iter();
        sensors
            .map(|(channel, sensor)| {
                let declared = sensor.declared;
                let errors = SensorErrors {
                    white_sigma: white_share * declared.noise_sigma,
                    coloured_sigma: colour.first_order_share_ratio * declared.noise_sigma,
                    coloured_time_constant_s: colour.time_constant_s,
                    offset: declared.offset_sigma * normal(),
                    gain_ratio: declared.gain_sigma_ratio * normal(),
                };
                (*channel, errors)
            })
            .collect()
    }

    /// Runs a case into a recording without truth, and gives the truth.
    ///
    /// # Errors
    /// Where the lab stops or the file cannot be written.
    pub(crate) fn run(
        &self,
        case: &Case,
        file: &Path,
        header: &RecordingHeader,
    ) -> Result<Truth, BlindError> {
        let mut writer = RecordingWriter::create(file, header)?;
        let points = self.drive(case, &mut writer)?;
        writer.finish()?;
        Ok(Truth::new(case, points))
    }

    /// Runs a case into memory.
    ///
    /// # Errors
    /// Where the lab stops.
    pub(crate) fn record(&self, case: &Case) -> Result<Recording, BlindError> {
        let mut recording = Recording::default();
        self.drive(case, &mut recording)?;
        Ok(recording)
    }

    fn drive(&self, case: &Case, keeper: &mut impl Keeper) -> Result<Vec<TruthPoint>, BlindError> {
        let of_lab = |source| BlindError::Lab { name: case.name.clone(), source };
        let mut lab = self.lab(case)?;
        lab.arm().map_err(of_lab)?;
        let timing = &self.campaign.timing;
        let mut truths = Vec::with_capacity(self.points.len());
        let mut now_s = 0.0;
        let mut before: Option<OperatingPoint> = None;
        for (index, (point, setpoints)) in self.points.iter().enumerate() {
            lab.set(setpoints).map_err(of_lab)?;
            if index == 0 && timing.warm_up_s > 0.0 {
                now_s += timing.warm_up_s;
                let mut batch = lab.poll(now_s).map_err(of_lab)?;
                batch.truth.clear();
                keeper.batch(&batch)?;
            }
            let step = StepMarker {
                index,
                kind: StepKind::Point,
                start_s: now_s,
                end_s: now_s + timing.dwell_s,
                from: before.replace(*point),
                to: Some(*point),
                p3_pa: setpoints.p3_pa,
                valve_opening_ratio: setpoints.valve_opening_ratio,
            };
            keeper.step(&step, StepPhase::Start)?;
            now_s = step.end_s;
            let mut batch = lab.poll(now_s).map_err(of_lab)?;
            truths.push(truth_at_end(&batch, point));
            // Truth is what the answers hold; a recording that is to be diagnosed has none.
            batch.truth.clear();
            keeper.batch(&batch)?;
            keeper.step(&step, StepPhase::End)?;
        }
        lab.disarm().map_err(of_lab)?;
        Ok(truths)
    }
}

/// Where a run goes.
trait Keeper {
    fn batch(&mut self, batch: &SampleBatch) -> Result<(), BlindError>;
    fn step(&mut self, step: &StepMarker, phase: StepPhase) -> Result<(), BlindError>;
}

impl Keeper for RecordingWriter {
    fn batch(&mut self, batch: &SampleBatch) -> Result<(), BlindError> {
        Ok(self.write_batch(batch)?)
    }

    fn step(&mut self, step: &StepMarker, phase: StepPhase) -> Result<(), BlindError> {
        Ok(self.write_step(step, phase)?)
    }
}

impl Keeper for Recording {
    fn batch(&mut self, batch: &SampleBatch) -> Result<(), BlindError> {
        for column in &batch.columns {
            let series = self.series.entry(column.channel).or_default();
            series.t_s.extend(&batch.t_s);
            series.values.extend(&column.values);
        }
        Ok(())
    }

    fn step(&mut self, step: &StepMarker, phase: StepPhase) -> Result<(), BlindError> {
        if phase == StepPhase::End {
            self.steps.push(*step);
        }
        Ok(())
    }
}

fn truth_at_end(batch: &SampleBatch, point: &OperatingPoint) -> TruthPoint {
    let last = |name: &str| {
        let column = batch.truth.iter().find(|column| column.name == name);
        column.and_then(|column| column.values.last().copied()).unwrap_or(f64::NAN)
    };
    TruthPoint {
        valve: point.valve_opening_ratio,
        speed_rpm: last("speed_rpm"),
        eta: last("eta"),
        h: last("h_w_m2k"),
    }
}
