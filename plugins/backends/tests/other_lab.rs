//! The lab with other equations: its limit is the lumped model, and its energy balance closes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_backends::other_lab::{OtherStructure, apply_structure};
use mapper_backends::virtual_lab::{LabSettings, Structure, VirtualLab};
use mapper_core::{Backend, Channel, MODELLED_CHANNELS, RigMode, SampleBatch, Setpoints};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::Watch;
use mapper_physics::simulation::steady;

const OPENING: f64 = 0.7;

fn setpoints(speed_rpm: f64) -> Setpoints {
    let boundary = BoundaryConditions { valve_opening_ratio: OPENING, ..Default::default() };
    let p3_pa = steady::hold_speed(&Model::nominal(), speed_rpm, &boundary).unwrap().boundary.p3_pa;
    Setpoints {
        mode: RigMode::Running,
        p3_pa,
        t3_k: 773.15,
        valve_opening_ratio: OPENING,
        oil_temperature_k: 323.15,
    }
}

/// Ten seconds at 110 krpm, 110 at 50 krpm, without noise.
fn recorded(structure: Option<OtherStructure>) -> SampleBatch {
    let mut settings = LabSettings::ideal(Model::nominal(), BoundaryConditions::default());
    if let Some(structure) = structure {
        apply_structure(&mut settings, structure);
    }
    let mut lab = VirtualLab::new(settings);
    lab.arm().unwrap();
    lab.set(&setpoints(110e3)).unwrap();
    lab.poll(10.0).unwrap();
    lab.set(&setpoints(50e3)).unwrap();
    lab.poll(120.0).unwrap()
}

fn column(batch: &SampleBatch, channel: Channel) -> &[f64] {
    &batch.columns.iter().find(|column| column.channel == channel).unwrap().values
}

/// With tightly coupled nodes, even h, mixed gas, almost no duct and fast sensors only the gas in the first volume remains,
/// with a residence time of a millisecond: a hundredth of the declared noise of one sample.
#[test]
fn tied_together_it_is_the_virtual_lab() {
    let limit = OtherStructure {
        housing_coupling_w_k: 1e5,
        uneven_h_ratio: 0.0,
        mixed_gas: true,
        duct_length_m: 1e-3,
        duct_loss_ratio: 0.0,
        volume_share_ratio: 0.02,
        hysteresis_ratio: 0.0,
        sensor_speed_ratio: f64::INFINITY,
        ..OtherStructure::default()
    };
    let (lumped, other) = (recorded(None), recorded(Some(limit)));
    for (channel, most) in [
        (Channel::ShaftSpeed, 1.0),
        (Channel::CompressorFlow, 1e-5),
        (Channel::P2, 1.0),
        (Channel::T2, 0.01),
        (Channel::Tc, 0.01),
        (Channel::Tt, 0.01),
    ] {
        // From a second after the jump on.
        let pairs = column(&lumped, channel).iter().zip(column(&other, channel)).skip(10);
        let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < most, "{channel}: {apart} apart, {most} allowed");
    }
}

/// With its default structure it is another machine: the affected readings differ by more than the declared noise.
#[test]
fn as_it_is_it_is_another_machine() {
    let (lumped, other) = (recorded(None), recorded(Some(OtherStructure::default())));
    assert_eq!(lumped.columns.len(), MODELLED_CHANNELS);
    let apart = |channel| {
        let pairs = column(&lumped, channel).iter().zip(column(&other, channel)).skip(10);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(
        apart(Channel::T2) > 0.1 && apart(Channel::Tc) > 0.3,
        "{} {}",
        apart(Channel::T2),
        apart(Channel::Tc)
    );
}

/// At rest all heat from both gases goes to the cell and the oil (the shaft's power goes from gas to gas).
#[test]
fn at_rest_the_energy_closes() {
    let model = Model::nominal();
    let mut boundary = BoundaryConditions { valve_opening_ratio: OPENING, ..Default::default() };
    boundary.p3_pa = setpoints(110e3).p3_pa;
    let inputs = mapper_backends::virtual_lab::LabInputs::constant(&boundary);
    for structure in [OtherStructure::default(), OtherStructure::two_masses()] {
        let mut machine = structure.settled(&model, 0.0, &boundary, Watch::default()).unwrap();
        let mut checked = 0;
        let mut on_sample = |_: f64, _: &_, outputs: &mapper_physics::simulation::model::Outputs| {
            let to_metal_w = outputs.compressor_heat_w + outputs.turbine.heat_w;
            let to_oil_w =
                model.params.bearing.oil_conductance_w_k * (outputs.bearing_k - boundary.oil_temperature_k);
            let to_cell_w = outputs.compressor_external_heat_w + outputs.turbine_external_heat_w;
            let left_w = to_metal_w - to_oil_w - to_cell_w;
            assert!(left_w.abs() < 1e-3, "{left_w} W of {to_metal_w} W");
            let flows = [outputs.flow_kg_s, outputs.valve_flow_kg_s];
            assert!((flows[0] / flows[1] - 1.0).abs() < 1e-6, "{flows:?}");
            checked += 1;
        };
        machine.run_to(1.0, &inputs, &mut [0.0, 0.5, 1.0].into_iter(), &mut on_sample, &mut |_| {}).unwrap();
        assert_eq!(checked, 3);
    }
}
