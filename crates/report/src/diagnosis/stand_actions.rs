//! Checks at the stand that confirm or exclude a cause.

use crate::diagnosis::gap_next::name_experiment;
use crate::formatting::{Message, number};
use mapper_diagnose::gap::{Diagnosis, Next, Verdict};

/// Probability below which a cause is not listed for a check while another one is open. Judgement: one visit in ten would find it.
const WORTH_A_CHECK: f64 = 0.1;

/// What to check for an effect of the library; one without a row gets the check of its part.
const EFFECTS: [(&str, &str); 34] = [
    ("actuator_lag", "time a step of the turbine inlet valve: command, position, pressure behind it"),
    ("area_split", "check the metal area before the wheel, and the distance of T1 from the housing"),
    ("bearing_friction", "check oil pressure, temperature and grade, and the run-down time of the shaft"),
    ("directional_htc", "check the housing's insulation, and compare heating with cooling at one point"),
    ("efficiency_scale", "check wheel and diffuser for dirt and damage, and the clearance of the wheel"),
    ("flow_map_scale", "look for leaks behind the flow meter, and compare machine and nominal map"),
    ("flowmeter_gain", "compare the flow meter with a second one, and look for leaks behind it"),
    ("flowmeter_lag", "check the filter of the flow meter, and the volume to the compressor"),
    ("htc_scale", "check the declared internal area of the compressor housing, and dirt on its wall"),
    ("humidity", "measure the humidity of the inlet air, and write it as `report.humidity`"),
    ("inlet_htc", "check the diameter of the inlet, and whether its pipe is insulated"),
    ("inlet_preheat", "insulate the pipe between the T1 probe and the wheel, or shorten it"),
    ("inner_node", "check the depth of the Tc probe: close to the gas it shows what counts"),
    ("oil_scale", "check flow, temperature and grade of the oil"),
    ("p2_offset", "compare the P2 transducer with the barometer while the machine is at rest"),
    ("recirculation", "check shroud bleed, recirculation valve and seals behind the wheel for leaks"),
    ("recovery", "check type and direction of the T2 probe; a shielded one recovers kinetic energy"),
    ("sheathed_probe", "check sheath and place of the T2 probe; a bare thin one follows faster"),
    ("stem_conduction", "check immersion depth of the T2 probe, and insulation of stem and pipe"),
    ("t1_offset", "compare the T1 probe with the others after a soak, and check its connector"),
    ("t2_offset", "compare the T2 probe with the others after a soak, and check its connector"),
    ("tc_offset", "compare the Tc probe with the others after a soak, and check its contact"),
    ("tip_diameter", "check the diameter of the T2 probe, and deposits on it"),
    ("turbine_efficiency", "check turbine wheel and vanes for damage, and the clearance of the wheel"),
    ("turbine_radiation", "put a heat shield between turbine and compressor housing, and repeat one jump"),
    ("slow_valve", "time a step of the back-pressure valve: command, position, its supply"),
    ("valve_area", "check zero and position of the back-pressure valve, and leaks before it"),
    ("valve_play", "approach a valve opening from both sides, and compare flow and position"),
    ("valve_stuck", "check the linkage of the back-pressure valve: position against command"),
    ("ventilation", "check fans, cell ventilation and the insulation of the housings"),
    ("t1_towards_wall", "check depth and stem of the T1 probe, and its distance from the housing"),
    ("turbine_capacity", "check turbine vanes, volute and flow meter for deposits and damage"),
    ("turbine_leak", "check the waste gate and the seals around the turbine wheel for leaks"),
    ("turbine_flow_gain", "compare the turbine flow meter with a second one, and look for leaks"),
];

/// Checks for a cause outside the library, by the part of the machine where it acts.
const PLACES: [(&str, &str); 19] = [
    ("actuator", "check the turbine inlet valve and its controller: setpoint, position, pressure"),
    ("turbine_flow", "check for leaks before the turbine, its vanes and the turbine flow meter"),
    ("shaft", "check the oil supply, the bearings, and whether another power is taken from the shaft"),
    ("compressor_flow", "look for leaks, recirculation and dirt, and check the nominal map"),
    ("flow_meter", "check range, filter setting and calibration of the flow meter"),
    ("outlet", "check the back-pressure valve and the volume and leaks behind the compressor"),
    ("compressor_gas", "look for heat to the gas between T1 and T2: cooler, injection, leaks"),
    ("t1_probe", "check the T1 probe: calibration, connector, place"),
    ("t2_probe", "check the T2 probe: calibration, immersion depth, insulation, deposits"),
    ("tc_probe", "check the Tc probe: calibration, depth, contact with the housing"),
    ("p2_sensor", "check the P2 transducer: calibration, range, pulse line"),
    ("p1_sensor", "check the P1 tap and transducer: calibration, and whether the tap sees dynamic pressure"),
    ("p3_sensor", "check the P3 tap and transducer: calibration, pulse line, dynamic pressure"),
    ("t3_probe", "check the T3 probe: calibration, radiation to the wall, mixing of the gas"),
    ("p4_sensor", "check the P4 tap and transducer: calibration, and whether the tap sees dynamic pressure"),
    ("oil_probe", "check the probe of the oil supply: calibration, immersion depth"),
    ("speed_sensor", "check the number of pulses per revolution that the speed sensor assumes"),
    ("compressor_housing", "look for coolant or oil in the housing, and check its insulation"),
    ("turbine_housing", "look for coolant in bearing or turbine housing; check oil, insulation"),
];

fn find_action(table: &[(&str, &'static str)], name: &str) -> Option<&'static str> {
    table.iter().find(|(known, _)| *known == name).map(|(_, action)| *action)
}

/// Checks in order of the probability of their causes, each once; empty if the rig is as declared.
pub(crate) fn stand_actions(diagnosis: &Diagnosis) -> Vec<String> {
    let mut actions: Vec<&str> = Vec::new();
    let named = diagnosis.verdict == Verdict::Explained;
    let open = diagnosis
        .candidates
        .iter()
        .enumerate()
        .filter(|(place, candidate)| candidate.probability >= WORTH_A_CHECK || (*place == 0 && named));
    if diagnosis.verdict == Verdict::WithinTolerance && diagnosis.offsets_at_rest.is_empty() {
        actions.extend(
            open.flat_map(|(_, candidate)| &candidate.effects).filter_map(|id| find_action(&EFFECTS, id)),
        );
    } else {
        if diagnosis.verdict != Verdict::WithinTolerance {
            let sets = open
                .flat_map(|(_, candidate)| std::iter::once(&candidate.effects).chain(&candidate.equivalent));
            actions.extend(sets.flatten().filter_map(|id| find_action(&EFFECTS, id)));
        }
        if diagnosis.verdict != Verdict::Explained || actions.is_empty() {
            actions.extend(
                diagnosis.locations.iter().take(2).filter_map(|place| find_action(&PLACES, &place.submodel)),
            );
        }
    }
    let mut once: Vec<String> = diagnosis
        .offsets_at_rest
        .iter()
        .map(|sensor| format!("calibrate this sensor: {}", sensor.message()))
        .collect();
    for action in actions {
        if !once.iter().any(|known| known == action) {
            once.push(action.to_owned());
        }
    }
    once
}

pub(crate) fn next_measurement(diagnosis: &Diagnosis) -> Option<String> {
    let first = diagnosis.experiments.first();
    Some(match diagnosis.next.as_ref()? {
        Next::Sensor { sensor, reason } => format!("mount {sensor}: {reason}"),
        Next::Jump { .. } | Next::Soak { .. } => {
            format!("measure: {}, {} min", name_experiment(first?), number(Some(first?.minutes), 1))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::{EFFECTS, PLACES, find_action};
    use mapper_physics::rig::effect::Submodel;

    #[test]
    fn checks_are_for_effects_that_exist_and_for_every_part() {
        let known: Vec<String> = mapper_effects::catalogue()
            .into_iter()
            .chain(mapper_physics::rig::sensor_fault::effects())
            .chain([true, false].into_iter().flat_map(mapper_physics::rig::sensor_fault::log_effects))
            .map(|effect| effect.info().id.to_string())
            .collect();
        let unknown: Vec<&str> =
            EFFECTS.iter().map(|(id, _)| *id).filter(|id| !known.iter().any(|known| known == id)).collect();
        assert!(unknown.is_empty(), "no such effects: {unknown:?}");
        assert!(Submodel::ALL.iter().all(|part| find_action(&PLACES, part.name()).is_some()));
    }
}
