//! The file as written -> the campaign: units resolved, defaults filled in.

use crate::campaign::{
    BackendChoice, Campaign, DisplayUnits, Identification, Jump, Limits, Machine, MapSource, OnDrift, Order,
    OutputFormat, Outputs, Repeats, Report, SensorDeclaration, SequenceSource, Stabilisation, Timing,
    WindowChoice, Zero,
};
use crate::consistency::{beside, rounded};
use crate::file::{
    BoundaryFile, CampaignFile, ChoiceName, ConvectionName, DisplayFile, EfficiencyName, FollowerName,
    FormatName, GeometryFile, GridFile, IdentificationFile, JointFile, LimitsFile, MachineFile, MapFile,
    MethodName, NamedReference, NamedRepeats, NusseltFile, OnDriftName, OrderName, OutputsFile, PointFile,
    ReferenceFile, RepeatedJumpFile, RepeatsFile, ReportFile, SensorsFile, TapName, TimingFile,
    TolerancesFile, WindowFile,
};
use crate::units::{Dimension, Fraction, Quantity};
use mapper_core::{
    Channel, Choice, ConvectionWithinStep, DeclaredUncertainty, EfficiencyWithinStep, JointSettings, Method,
    ModelTolerances, OperatingPoint, ReferenceState,
};
use mapper_physics::follow_outlet::FollowOutlet;
use mapper_physics::params::{BoundaryConditions, Params};
use mapper_yaml::{Step, steps};
use std::collections::{BTreeMap, HashSet};
use std::io;
use std::path::Path;

/// The campaign, and for each of its points the place in the file it came from.
pub(crate) struct Built {
    pub campaign: Campaign,
    pub point_paths: Vec<Vec<Step>>,
}

/// Builds the campaign of a file without mistakes.
///
/// # Errors
/// Only where the map file or the sequence script can no longer be read.
pub(crate) fn build(
    file: CampaignFile,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
) -> io::Result<Built> {
    let reference = file.reference.map_or(ReferenceState::SAE, reference_state);
    let (points, point_paths) = points(&file.grid);
    let probe_diameter_m = or(file.sensors.t2.probe_diameter, 0.0);
    let machine = machine(file.machine, probe_diameter_m, origin, files)?;
    let sequence = match file.sequence {
        None => None,
        Some(name) => {
            let path = beside(origin, &name);
            let text = files(&path)?;
            Some(SequenceSource { path, text })
        }
    };
    let (name, settings) = file.backend.into_iter().next().unwrap_or_default();
    let campaign = Campaign {
        name: file.campaign,
        description: file.description,
        boundary: boundary(&file.boundary),
        follow_outlet: follow_outlet(file.boundary.follow_outlet.as_deref().unwrap_or_default()),
        sensors: sensors(&file.sensors),
        tolerances: tolerances(file.tolerances.unwrap_or_default()),
        backend: BackendChoice { name, settings },
        timing: timing(&file.timing),
        zero: file.zero.map(|zero| Zero {
            soak_s: zero.soak.inside,
            oil_temperature_k: or(zero.oil_temperature, file.boundary.inlet_temperature.inside),
        }),
        identification: identification(
            &file.identification.unwrap_or_default(),
            machine.params.compressor.alpha_area_ratio,
        ),
        order: match file.order {
            Some(OrderName::SumGradient) | None => Order::SumGradient,
            Some(OrderName::WorstGradient) => Order::WorstGradient,
            Some(OrderName::Information) => Order::Information,
            Some(OrderName::Time) => Order::Time,
            Some(OrderName::Greedy) => Order::Greedy,
            Some(OrderName::Listed) => Order::Listed,
        },
        sequence,
        required_sigma_eta: file.required_sigma_eta.map(|quantity| quantity.inside),
        repeats: repeats(file.repeats),
        on_drift: file.drift.map(|drift| match drift.on_drift {
            OnDriftName::Hold => OnDrift::Hold,
            OnDriftName::Continue => OnDrift::Continue,
            OnDriftName::Zero => OnDrift::Zero,
        }),
        points,
        seed: file.seed.unwrap_or(1),
        limits: limits(&file.limits),
        reference,
        outputs: outputs(file.outputs.unwrap_or_default()),
        report: report(file.report.unwrap_or_default()),
        display: display(file.display.unwrap_or_default()),
        machine,
    };
    Ok(Built { campaign, point_paths })
}

fn or<D: Dimension>(quantity: Option<Quantity<D>>, default: f64) -> f64 {
    quantity.map_or(default, |quantity| quantity.inside)
}

/// Overwrites a default with what the file says.
fn set<D: Dimension>(target: &mut f64, quantity: Option<Quantity<D>>) {
    *target = or(quantity, *target);
}

fn tolerances(file: TolerancesFile) -> ModelTolerances {
    let mut tolerances = ModelTolerances::default();
    set(&mut tolerances.flow_meter_gain_ratio, file.flow_meter_gain);
    set(&mut tolerances.flow_map_ratio, file.flow_map);
    set(&mut tolerances.compressor_efficiency_ratio, file.compressor_efficiency);
    set(&mut tolerances.efficiency_shape_ratio, file.efficiency_shape);
    set(&mut tolerances.turbine_efficiency_ratio, file.turbine_efficiency);
    set(&mut tolerances.valve_area_ratio, file.valve_area);
    set(&mut tolerances.convection_ratio, file.convection);
    set(&mut tolerances.external_convection_ratio, file.external_convection);
    set(&mut tolerances.oil_conductance_ratio, file.oil_conductance);
    set(&mut tolerances.actuator_lag_s, file.actuator_lag);
    tolerances
}

fn set_number(target: &mut f64, number: Option<f64>) {
    *target = number.unwrap_or(*target);
}

fn reference_state(file: ReferenceFile) -> ReferenceState {
    match file {
        ReferenceFile::Named(NamedReference::Sae) => ReferenceState::SAE,
        ReferenceFile::Named(NamedReference::Garrett) => ReferenceState::GARRETT,
        ReferenceFile::Named(NamedReference::BorgWarner) => ReferenceState::BORGWARNER,
        ReferenceFile::State(state) => {
            ReferenceState { t_ref_k: state.temperature.inside, p_ref_pa: state.pressure.inside }
        }
    }
}

fn machine(
    file: MachineFile,
    probe_diameter_m: f64,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
) -> io::Result<Machine> {
    let map = match file.map {
        MapFile::Named(_) => MapSource::ClosedForm,
        MapFile::Table(table) => {
            let path = beside(origin, &table.file);
            let text = files(&path)?;
            MapSource::Table { path, text, reference: reference_state(table.reference) }
        }
    };
    let mut params = geometry(file.geometry.unwrap_or_default());
    params.t2_probe_diameter_m = probe_diameter_m;
    Ok(Machine { name: file.name, serial_number: file.serial_number, params, map })
}

fn geometry(file: GeometryFile) -> Params {
    let mut params = Params::default();
    let from = file.compressor.unwrap_or_default();
    let to = &mut params.compressor;
    set(&mut to.internal_area_m2, from.internal_area);
    set_number(&mut to.alpha_area_ratio, from.alpha_area);
    set(&mut to.outlet_diameter_m, from.outlet_diameter);
    set(&mut to.wheel_diameter_m, from.wheel_diameter);
    set(&mut to.housing_mass_kg, from.housing_mass);
    set(&mut to.external_area_m2, from.external_area);
    set_number(&mut to.emissivity_ratio, from.emissivity);
    nusselt(&mut to.nusselt_coefficient, &mut to.nusselt_exponent, from.nusselt);
    let from = file.turbine.unwrap_or_default();
    let to = &mut params.turbine;
    set(&mut to.internal_area_m2, from.internal_area);
    set(&mut to.inlet_diameter_m, from.inlet_diameter);
    set(&mut to.wheel_radius_m, from.wheel_radius);
    set(&mut to.housing_mass_kg, from.housing_mass);
    set(&mut to.external_area_m2, from.external_area);
    set_number(&mut to.emissivity_ratio, from.emissivity);
    nusselt(&mut to.nusselt_coefficient, &mut to.nusselt_exponent, from.nusselt);
    set(&mut to.choked_flow_kg_s, from.choked_flow);
    set_number(&mut to.peak_efficiency, from.peak_efficiency);
    set_number(&mut to.peak_blade_speed_ratio, from.peak_blade_speed_ratio);
    let from = file.bearing.unwrap_or_default();
    let to = &mut params.bearing;
    set(&mut to.conductivity_w_mk, from.conductivity);
    set(&mut to.section_area_m2, from.section_area);
    set(&mut to.length_m, from.length);
    set(&mut to.oil_conductance_w_k, from.oil_conductance);
    set(&mut params.shaft_inertia_kgm2, file.shaft_inertia);
    let from = file.outlet.unwrap_or_default();
    let to = &mut params.outlet;
    set(&mut to.volume_m3, from.volume);
    set(&mut to.valve_area_m2, from.valve_area);
    set_number(&mut to.discharge_coefficient, from.discharge_coefficient);
    params
}

fn nusselt(coefficient: &mut f64, exponent: &mut f64, file: Option<NusseltFile>) {
    let file = file.unwrap_or_default();
    set_number(coefficient, file.coefficient);
    set_number(exponent, file.exponent);
}

fn boundary(file: &BoundaryFile) -> BoundaryConditions {
    BoundaryConditions {
        t1_k: file.inlet_temperature.inside,
        p1_pa: file.inlet_pressure.inside,
        p3_pa: file.turbine_outlet_pressure.inside,
        t3_k: file.turbine_inlet_temperature.inside,
        p4_pa: file.turbine_outlet_pressure.inside,
        oil_temperature_k: file.oil_temperature.inside,
        ambient_temperature_k: or(file.ambient_temperature, file.inlet_temperature.inside),
        valve_opening_ratio: 1.0,
    }
}

fn follow_outlet(followers: &[FollowerName]) -> FollowOutlet {
    FollowOutlet {
        turbine_inlet: followers.contains(&FollowerName::TurbineInletTemperature),
        oil: followers.contains(&FollowerName::OilTemperature),
    }
}

fn sensors(file: &SensorsFile) -> BTreeMap<Channel, SensorDeclaration> {
    fn declared<D: Dimension>(
        noise: Quantity<D>,
        offset: Option<Quantity<D>>,
        gain: Option<Quantity<Fraction>>,
    ) -> SensorDeclaration {
        SensorDeclaration {
            declared: DeclaredUncertainty {
                noise_sigma: noise.inside,
                offset_sigma: or(offset, 0.0),
                gain_sigma_ratio: or(gain, 0.0),
            },
            static_tap_pipe_diameter_m: None,
            probe_diameter_m: 0.0,
        }
    }
    let mut all = BTreeMap::from([
        (Channel::ShaftSpeed, declared(file.n.noise, file.n.offset, file.n.gain)),
        (
            Channel::T2,
            SensorDeclaration {
                probe_diameter_m: or(file.t2.probe_diameter, 0.0),
                ..declared(file.t2.noise, file.t2.offset, file.t2.gain)
            },
        ),
    ]);
    for (channel, sensor) in
        [(Channel::CompressorFlow, Some(&file.m_c)), (Channel::TurbineFlow, file.m_t.as_ref())]
    {
        all.extend(sensor.map(|s| (channel, declared(s.noise, s.offset, s.gain))));
    }
    let pressures = [
        (Channel::P1, Some(&file.p1)),
        (Channel::P2, Some(&file.p2)),
        (Channel::P3, file.p3.as_ref()),
        (Channel::P4, file.p4.as_ref()),
    ];
    for (channel, sensor) in pressures {
        all.extend(sensor.map(|s| {
            let diameter = s.pipe_diameter.map(|diameter| diameter.inside);
            let static_tap_pipe_diameter_m = diameter.filter(|_| s.tap == Some(TapName::Static));
            (channel, SensorDeclaration { static_tap_pipe_diameter_m, ..declared(s.noise, s.offset, s.gain) })
        }));
    }
    let temperatures = [
        (Channel::T1, Some(&file.t1)),
        (Channel::Tc, Some(&file.tc)),
        (Channel::T3, file.t3.as_ref()),
        (Channel::T4, file.t4.as_ref()),
        (Channel::Tt, file.tt.as_ref()),
        (Channel::TOil, file.t_oil.as_ref()),
        (Channel::TAmb, file.t_amb.as_ref()),
    ];
    for (channel, sensor) in temperatures {
        all.extend(sensor.map(|s| (channel, declared(s.noise, s.offset, s.gain))));
    }
    all
}

/// The points and where each stands: its entry in `points`, or its speed in `speeds`.
fn points(grid: &GridFile) -> (Vec<OperatingPoint>, Vec<Vec<Step>>) {
    let key = |speed_rpm: f64, opening: f64| rounded(speed_rpm, opening);
    if let Some(listed) = &grid.points {
        return listed
            .iter()
            .enumerate()
            .map(|(index, point)| {
                let point =
                    OperatingPoint { speed_rpm: point.speed.0.inside, valve_opening_ratio: point.opening.0 };
                (point, steps!["grid", "points", index].to_vec())
            })
            .unzip();
    }
    let skipped: HashSet<_> =
        grid.skip.iter().flatten().map(|point| key(point.speed.0.inside, point.opening.0)).collect();
    let speeds = grid.speeds.as_deref().unwrap_or_default();
    grid.openings
        .iter()
        .flatten()
        .flat_map(|opening| {
            speeds.iter().enumerate().map(move |(index, speed)| (index, speed.0.inside, opening.0))
        })
        .filter(|(_, speed_rpm, opening)| !skipped.contains(&key(*speed_rpm, *opening)))
        .map(|(index, speed_rpm, valve_opening_ratio)| {
            (OperatingPoint { speed_rpm, valve_opening_ratio }, steps!["grid", "speeds", index].to_vec())
        })
        .unzip()
}

fn timing(file: &TimingFile) -> Timing {
    Timing {
        warm_up_s: or(file.warm_up, 0.0),
        cool_down_s: or(file.cool_down, 0.0),
        dwell_s: file.dwell.inside,
    }
}

fn identification(file: &IdentificationFile, alpha_area_ratio: f64) -> Identification {
    let mut stabilisation = Stabilisation::default();
    if let Some(limits) = &file.stabilisation {
        set(&mut stabilisation.speed_ratio, limits.speed);
        set(&mut stabilisation.flow_ratio, limits.flow);
        set(&mut stabilisation.pressure_ratio_ratio, limits.pressure_ratio);
    }
    Identification {
        method: match file.method {
            Some(MethodName::Steady) => Method::Steady,
            Some(MethodName::Joint) => Method::Joint,
            Some(MethodName::Dynamic) | None => Method::Dynamic,
        },
        window: match file.window {
            Some(WindowFile::Fixed(window)) => {
                WindowChoice::Fixed { start_s: window.start.inside, end_s: window.end.inside }
            }
            Some(WindowFile::Named(_)) | None => WindowChoice::Auto,
        },
        alpha_area_ratio: file.alpha_area.unwrap_or(alpha_area_ratio),
        stabilisation,
        joint: joint(file.joint.unwrap_or_default()),
    }
}

fn joint(file: JointFile) -> JointSettings {
    let choice = |name: Option<ChoiceName>| match name {
        Some(ChoiceName::Fixed) => Choice::Fixed,
        Some(ChoiceName::Fitted) | None => Choice::Fitted,
    };
    JointSettings {
        alpha_area: choice(file.alpha_area),
        probe: choice(file.probe),
        direction: choice(file.direction),
        offsets: choice(file.offsets),
        efficiency: match file.efficiency {
            Some(EfficiencyName::Constant) => EfficiencyWithinStep::Constant,
            Some(EfficiencyName::Shaped) | None => EfficiencyWithinStep::Shaped,
        },
        h: match file.h {
            Some(ConvectionName::Constant) => ConvectionWithinStep::Constant,
            Some(ConvectionName::Law) | None => ConvectionWithinStep::Law,
        },
    }
}

/// Repeats unless the file switches them off.
fn repeats(file: Option<RepeatsFile>) -> Option<Repeats> {
    let file = match file {
        Some(RepeatsFile::Jump(file)) => file,
        Some(RepeatsFile::Named(NamedRepeats::Off)) => return None,
        None => RepeatedJumpFile::default(),
    };
    let point = |file: PointFile| OperatingPoint {
        speed_rpm: file.speed.0.inside,
        valve_opening_ratio: file.opening.0,
    };
    Some(Repeats {
        jump: file.jump.map(|jump| Jump { from: point(jump.from), to: point(jump.to) }),
        every_steps: file.every.unwrap_or(12),
        at_least: file.at_least.unwrap_or(2),
    })
}

fn limits(file: &LimitsFile) -> Limits {
    Limits {
        speed_max_rpm: file.speed.inside,
        p3_min_pa: file.turbine_inlet_pressure.min.inside,
        p3_max_pa: file.turbine_inlet_pressure.max.inside,
        t3_max_k: file.turbine_inlet_temperature.map(|limit| limit.inside),
        t2_max_k: file.compressor_outlet_temperature.map(|limit| limit.inside),
        surge_margin_min_ratio: file.surge_margin.map(|limit| limit.inside),
        housing_gradient_max_k: file.housing_gradient.map(|limit| limit.inside),
        p3_stroke_s: file.turbine_inlet_pressure.stroke.map(|stroke| stroke.inside),
    }
}

fn outputs(file: OutputsFile) -> Outputs {
    let usual = vec![FormatName::Csv, FormatName::Json, FormatName::Svg, FormatName::Fitted];
    let formats = file.formats.unwrap_or(usual).into_iter().map(|format| match format {
        FormatName::Csv => OutputFormat::Csv,
        FormatName::Json => OutputFormat::Json,
        FormatName::Svg => OutputFormat::Svg,
        FormatName::Png => OutputFormat::Png,
        FormatName::Sae => OutputFormat::Sae,
        FormatName::Fitted => OutputFormat::Fitted,
        FormatName::Modelica => OutputFormat::Modelica,
        FormatName::Simscape => OutputFormat::Simscape,
        FormatName::Npss => OutputFormat::Npss,
        FormatName::Pycycle => OutputFormat::Pycycle,
    });
    Outputs { directory: file.directory.unwrap_or_else(|| "runs".into()), formats: formats.collect() }
}

fn report(file: ReportFile) -> Report {
    Report {
        operator: file.operator,
        test_cell: file.test_cell,
        calibration: file
            .calibration
            .unwrap_or_default()
            .into_iter()
            .map(|(symbol, date)| (symbol.0, date.0))
            .collect(),
        barometer_pa: file.barometer.map(|value| value.inside),
        humidity_ratio: file.humidity.map(|value| value.inside),
        cell_temperature_k: file.cell_temperature.map(|value| value.inside),
    }
}

fn display(file: DisplayFile) -> DisplayUnits {
    let default = DisplayUnits::default();
    DisplayUnits {
        temperature: file.temperature.unwrap_or(default.temperature),
        pressure: file.pressure.unwrap_or(default.pressure),
        speed: file.speed.unwrap_or(default.speed),
        flow: file.flow.unwrap_or(default.flow),
    }
}
