//! Two hundred headers from names, units, languages and station conventions: what is called sure must have the right column and unit.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::Channel::{
    self, CompressorFlow, P1, P2, P3, P4, ShaftSpeed, T1, T2, T3, T4, TOil, TOilOut, Tc, TurbineFlow,
};
use mapper_core::{MapDescription, ReferenceState};
use mapper_log_formats::LOG_FORMATS;
use mapper_maps::table::read_any_text;
use mapper_recording::logs::proposal::{Certainty, propose};
use mapper_recording::logs::{LogFile, LogOptions, survey};
use mapper_table::header_unit;
use std::path::Path;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Holds {
    /// A channel of the turbocharger.
    A(Channel),
    /// Something else with a temperature, a pressure, a speed or a flow.
    Other(Kind, f64, f64),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Temperature,
    Pressure,
    Speed,
    Flow,
}

const fn temperature(low_k: f64, high_k: f64) -> Holds {
    Holds::Other(Kind::Temperature, low_k, high_k)
}

const fn pressure(low_pa: f64, high_pa: f64) -> Holds {
    Holds::Other(Kind::Pressure, low_pa, high_pa)
}

/// Value at a load of 0 to 1 in SI units (speed in rpm), and the kind.
fn value(holds: Holds, load: f64) -> (Kind, f64) {
    let between = |low: f64, high: f64| low + (high - low) * load;
    match holds {
        Holds::Other(kind, low, high) => (kind, between(low, high)),
        Holds::A(channel) => match channel {
            P1 => (Kind::Pressure, between(98.6e3, 96.7e3)),
            P2 => (Kind::Pressure, between(103e3, 232e3)),
            P3 => (Kind::Pressure, between(102e3, 217e3)),
            P4 => (Kind::Pressure, between(98.9e3, 100.2e3)),
            T1 => (Kind::Temperature, between(295.4, 296.0)),
            T2 => (Kind::Temperature, between(301.0, 407.0)),
            T3 => (Kind::Temperature, between(560.0, 798.0)),
            T4 => (Kind::Temperature, between(540.0, 720.0)),
            Tc => (Kind::Temperature, between(299.0, 357.0)),
            TOil => (Kind::Temperature, between(334.0, 343.0)),
            TOilOut => (Kind::Temperature, between(345.0, 356.0)),
            ShaftSpeed => (Kind::Speed, between(22e3, 118e3)),
            TurbineFlow => (Kind::Flow, between(0.011, 0.1545)),
            _ => (Kind::Flow, between(0.0105, 0.1522)),
        },
    }
}

/// Ambient pressure of gauge pressures, Pa.
const AMBIENT_PA: f64 = 98.6e3;

/// Units as a log writes them: name, and the number of an SI value.
type Unit = (&'static str, fn(f64) -> f64);

/// Temperature, pressure, speed, flow.
const UNITS: [[Unit; 4]; 6] = [
    [("degC", |k| k - 273.15), ("kPa", |pa| pa / 1e3), ("rpm", |n| n), ("kg/s", |m| m)],
    [
        ("°F", |k| k * 1.8 - 459.67),
        ("psia", |pa| pa / 6894.757),
        ("rpm", |n| n),
        ("lb/min", |m| m / 0.453_592_37 * 60.0),
    ],
    [("K", |k| k), ("bar", |pa| pa / 1e5), ("1/min", |n| n), ("kg/h", |m| m * 3600.0)],
    [("°C", |k| k - 273.15), ("mbar", |pa| pa / 100.0), ("krpm", |n| n / 1e3), ("g/s", |m| m * 1e3)],
    [
        ("degC", |k| k - 273.15),
        ("kPa(g)", |pa| (pa - AMBIENT_PA) / 1e3),
        ("U/min", |n| n),
        ("kg/min", |m| m * 60.0),
    ],
    [("", |k| k - 273.15), ("", |pa| pa / 1e3), ("", |n| n), ("", |m| m)],
];

/// Names of the measured quantities by convention.
fn conventions() -> Vec<Vec<(&'static str, Holds)>> {
    let a = Holds::A;
    // Of pressures and temperatures behind an intercooler.
    let (cooled_p, cooled_t) = (pressure(102e3, 228e3), temperature(299.0, 318.0));
    vec![
        vec![
            ("P1", a(P1)),
            ("T1", a(T1)),
            ("P2", a(P2)),
            ("T2", a(T2)),
            ("P3", a(P3)),
            ("T3", a(T3)),
            ("P4", a(P4)),
            ("T4", a(T4)),
            ("n_TC", a(ShaftSpeed)),
            ("m_dot_C", a(CompressorFlow)),
        ],
        vec![
            ("P2", a(P1)),
            ("T2", a(T1)),
            ("P3", a(P2)),
            ("T3", a(T2)),
            ("P4", a(P3)),
            ("T4", a(T3)),
            ("P5", a(P4)),
            ("T5", a(T4)),
            ("N1", a(ShaftSpeed)),
            ("W2", a(CompressorFlow)),
        ],
        vec![
            ("p_21", a(P1)),
            ("T_21", a(T1)),
            ("p_22", a(P2)),
            ("T_22", a(T2)),
            ("p_31", a(P3)),
            ("T_31", a(T3)),
            ("p_41", a(P4)),
            ("T_41", a(T4)),
            ("N_ATL", a(ShaftSpeed)),
        ],
        vec![
            ("p_11", a(P1)),
            ("T_11", a(T1)),
            ("p_21", a(P2)),
            ("T_21", a(T2)),
            ("p_22", cooled_p),
            ("T_22", cooled_t),
            ("p_31", a(P3)),
            ("T_31", a(T3)),
            ("p_41", a(P4)),
            ("T_41", a(T4)),
        ],
        vec![
            ("Compressor inlet pressure", a(P1)),
            ("Compressor inlet temperature", a(T1)),
            ("Compressor outlet pressure", a(P2)),
            ("Compressor outlet temperature", a(T2)),
            ("Turbine inlet pressure", a(P3)),
            ("Turbine inlet temperature", a(T3)),
            ("Turbine outlet pressure", a(P4)),
            ("Turbine outlet temperature", a(T4)),
            ("Turbo speed", a(ShaftSpeed)),
            ("Air mass flow", a(CompressorFlow)),
        ],
        vec![
            ("Druck vor Verdichter", a(P1)),
            ("Temperatur vor Verdichter", a(T1)),
            ("Druck nach Verdichter", a(P2)),
            ("Temperatur nach Verdichter", a(T2)),
            ("Druck vor Turbine", a(P3)),
            ("Temperatur vor Turbine", a(T3)),
            ("Druck nach Turbine", a(P4)),
            ("Temperatur nach Turbine", a(T4)),
            ("Drehzahl ATL", a(ShaftSpeed)),
            ("Luftmassenstrom", a(CompressorFlow)),
            ("Temperatur nach Ladeluftkühler", cooled_t),
            ("Druck nach Ladeluftkühler", cooled_p),
        ],
        vec![
            ("Pression entrée compresseur", a(P1)),
            ("Température entrée compresseur", a(T1)),
            ("Pression sortie compresseur", a(P2)),
            ("Température sortie compresseur", a(T2)),
            ("Pression avant turbine", a(P3)),
            ("Température avant turbine", a(T3)),
            ("Pression après turbine", a(P4)),
            ("Température après turbine", a(T4)),
            ("Régime turbo", a(ShaftSpeed)),
            ("Débit air", a(CompressorFlow)),
            ("Température eau", temperature(350.0, 365.0)),
        ],
        vec![
            ("Presión entrada compresor", a(P1)),
            ("Temperatura entrada compresor", a(T1)),
            ("Presión salida compresor", a(P2)),
            ("Temperatura salida compresor", a(T2)),
            ("Presión entrada turbina", a(P3)),
            ("Temperatura entrada turbina", a(T3)),
            ("Presión salida turbina", a(P4)),
            ("Temperatura salida turbina", a(T4)),
            ("Velocidad turbo", a(ShaftSpeed)),
            ("Caudal aire", a(CompressorFlow)),
        ],
        vec![
            ("CIP", a(P1)),
            ("CIT", a(T1)),
            ("COP", a(P2)),
            ("COT", a(T2)),
            ("TIP", a(P3)),
            ("TIT", a(T3)),
            ("TOP", a(P4)),
            ("TOT", a(T4)),
            ("Shaft Speed", a(ShaftSpeed)),
            ("MAF", a(CompressorFlow)),
        ],
        vec![
            ("P1tot", a(P1)),
            ("T1tot", a(T1)),
            ("P2tot", a(P2)),
            ("T2tot", a(T2)),
            ("P3tot", a(P3)),
            ("T3tot", a(T3)),
            ("T1stat", temperature(293.0, 294.0)),
            ("T2stat", temperature(299.0, 404.0)),
            ("nATL", a(ShaftSpeed)),
            ("M1", a(CompressorFlow)),
            ("M3", a(TurbineFlow)),
        ],
        vec![
            ("T_c", a(T2)),
            ("T_t", a(T4)),
            ("p_c", a(P2)),
            ("T_1", a(T1)),
            ("p_1", a(P1)),
            ("n", a(ShaftSpeed)),
        ],
        vec![
            ("RPM", Holds::Other(Kind::Speed, 900.0, 5700.0)),
            ("Boost", a(P2)),
            ("Intake Air Temp", temperature(305.0, 318.0)),
            ("Charge Air Temp", cooled_t),
            ("MAF", a(CompressorFlow)),
            ("EGT", a(T3)),
            ("Coolant Temp", temperature(350.0, 365.0)),
            ("Fuel Pressure", pressure(350e3, 500e3)),
            ("Oil Pressure", pressure(200e3, 450e3)),
        ],
        vec![
            ("T_comp_in", a(T1)),
            ("T_comp_out", a(T2)),
            ("p_comp_in", a(P1)),
            ("p_comp_out", a(P2)),
            ("T_turb_in", a(T3)),
            ("T_turb_out", a(T4)),
            ("p_turb_in", a(P3)),
            ("p_turb_out", a(P4)),
            ("T_comp_housing", a(Tc)),
            ("T_oil_in", a(TOil)),
            ("T_oil_out", a(TOilOut)),
            ("p_oil_in", pressure(250e3, 300e3)),
            ("n_turbo", a(ShaftSpeed)),
        ],
        vec![
            ("T2_LP", a(T2)),
            ("P2_LP", a(P2)),
            ("T1_LP", a(T1)),
            ("P1_LP", a(P1)),
            ("T1_HP", temperature(310.0, 330.0)),
            ("P1_HP", pressure(102e3, 225e3)),
            ("T2_HP", temperature(320.0, 450.0)),
            ("P2_HP", pressure(110e3, 400e3)),
            ("n_LP", a(ShaftSpeed)),
            ("n_HP", Holds::Other(Kind::Speed, 30e3, 150e3)),
        ],
        vec![
            ("p_L_v_Verd", a(P1)),
            ("T_L_v_Verd", a(T1)),
            ("p_L_n_Verd", a(P2)),
            ("T_L_n_Verd", a(T2)),
            ("p_A_v_Turb", a(P3)),
            ("T_A_v_Turb", a(T3)),
            ("p_A_n_Turb", a(P4)),
            ("T_A_n_Turb", a(T4)),
            ("n_Lader", a(ShaftSpeed)),
            ("T_L_n_LLK", cooled_t),
        ],
        vec![
            ("Pressione ingresso compressore", a(P1)),
            ("Temperatura ingresso compressore", a(T1)),
            ("Pressione uscita compressore", a(P2)),
            ("Temperatura uscita compressore", a(T2)),
            ("Pressione ingresso turbina", a(P3)),
            ("Temperatura ingresso turbina", a(T3)),
            ("Giri turbo", a(ShaftSpeed)),
            ("Portata aria", a(CompressorFlow)),
        ],
        vec![
            ("compInletPressTotal", a(P1)),
            ("compInletTempTotal", a(T1)),
            ("Prs_CmprOutlet", a(P2)),
            ("Tmp_CmprOutlet", a(T2)),
            ("turbInletPressTotal", a(P3)),
            ("turbInletTempTotal", a(T3)),
            ("nTurbo", a(ShaftSpeed)),
            ("compMassFlow", a(CompressorFlow)),
            ("CAC in T", temperature(301.0, 407.0)),
            ("CAC out T", cooled_t),
        ],
        vec![
            ("压气机进口压力", a(P1)),
            ("压气机进口温度", a(T1)),
            ("压气机出口压力", a(P2)),
            ("压气机出口温度", a(T2)),
            ("涡轮前压力", a(P3)),
            ("涡轮前温度", a(T3)),
            ("增压器转速", a(ShaftSpeed)),
            ("空气流量", a(CompressorFlow)),
            ("发动机转速", Holds::Other(Kind::Speed, 900.0, 3700.0)),
            ("中冷后温度", cooled_t),
        ],
        vec![
            ("Давление перед компрессором", a(P1)),
            ("Температура на входе в компрессор", a(T1)),
            ("Давление за компрессором", a(P2)),
            ("Температура на выходе из компрессора", a(T2)),
            ("Давление перед турбиной", a(P3)),
            ("Температура перед турбиной", a(T3)),
            ("Частота вращения ротора", a(ShaftSpeed)),
            ("Расход воздуха", a(CompressorFlow)),
            ("Расход топлива", Holds::Other(Kind::Flow, 0.0005, 0.006)),
        ],
        vec![
            ("PT-101", a(P1)),
            ("TT-101", a(T1)),
            ("PT-102", a(P2)),
            ("TT-102", a(T2)),
            ("TE-3", a(T3)),
            ("SE-1", a(ShaftSpeed)),
            ("FT-3", a(CompressorFlow)),
        ],
        vec![
            ("Pressure", a(P1)),
            ("Temp", a(T1)),
            ("Pressure.1", a(P2)),
            ("Temp.1", a(T2)),
            ("Speed", a(ShaftSpeed)),
            ("Flow", a(CompressorFlow)),
        ],
    ]
}

/// Other columns of logs, which are not channels.
const DECOYS: [(&str, Holds); 20] = [
    ("T2 set", temperature(300.0, 400.0)),
    ("P2_soll", pressure(105e3, 230e3)),
    ("n_corr", Holds::Other(Kind::Speed, 21e3, 117e3)),
    ("mass flow corr", Holds::Other(Kind::Flow, 0.011, 0.16)),
    ("Engine speed", Holds::Other(Kind::Speed, 1000.0, 4000.0)),
    ("Fuel flow", Holds::Other(Kind::Flow, 0.0005, 0.006)),
    ("EGR temperature", temperature(330.0, 420.0)),
    ("T_cooler_out", temperature(299.0, 318.0)),
    ("Cylinder pressure", pressure(110e3, 1.5e6)),
    ("T2 calc", temperature(300.0, 404.0)),
    ("Dyno speed", Holds::Other(Kind::Speed, 1000.0, 4000.0)),
    ("Kraftstofftemperatur", temperature(300.0, 310.0)),
    ("T_water_out", temperature(350.0, 366.0)),
    ("p_crankcase", pressure(100e3, 101e3)),
    ("T2 isentropic", temperature(300.0, 390.0)),
    ("Intake Manifold Pressure", pressure(102e3, 228e3)),
    ("T2-T1", temperature(290.0, 380.0)),
    ("T2 limit", temperature(410.0, 411.0)),
    ("P2 alarm", pressure(240e3, 241e3)),
    ("Pressure drop compressor inlet filter", pressure(98e3, 99e3)),
];

/// Repeats a small sequence of numbers: the same headers in every run.
struct Draw(u64);

impl Draw {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % limit
    }
}

/// A generated header: its columns, the units of its quantities and the style of its headings.
struct Header {
    columns: Vec<(&'static str, Holds)>,
    units: [Unit; 4],
    style: usize,
}

impl Header {
    fn generate(draw: &mut Draw, index: usize) -> Header {
        let conventions = conventions();
        let mut columns = conventions[index % conventions.len()].clone();
        for _ in 0..draw.below(5) {
            let decoy = DECOYS[draw.below(DECOYS.len())];
            let at = draw.below(columns.len() + 1);
            if columns.iter().all(|(name, _)| *name != decoy.0) {
                columns.insert(at, decoy);
            }
        }
        Header { columns, units: UNITS[draw.below(UNITS.len())], style: draw.below(3) }
    }

    fn unit_of(&self, holds: Holds) -> Unit {
        self.units[value(holds, 0.0).0 as usize]
    }

    fn title(&self, name: &str, holds: Holds) -> String {
        match (self.unit_of(holds).0, self.style) {
            ("", _) => name.to_owned(),
            (unit, 0) => format!("{name} [{unit}]"),
            (unit, 1) => format!("{} / {unit}", name.to_uppercase()),
            (unit, _) => format!("{name} ({unit})"),
        }
    }

    fn titles(&self) -> Vec<String> {
        self.columns.iter().map(|(name, holds)| self.title(name, *holds)).collect()
    }

    /// A row of the table at a load of 0 to 1, with some noise, so that no two columns are equal.
    fn row(&self, load: f64, draw: &mut Draw) -> String {
        let mut row = String::new();
        for (_, holds) in &self.columns {
            let noisy = load + 1e-3 * (draw.below(1000) as f64 / 1000.0 - 0.5);
            row += &format!(";{:.5}", self.unit_of(*holds).1(value(*holds, noisy).1));
        }
        row
    }
}

/// Number of generated headers.
const HEADERS: usize = 240;

#[test]
fn what_is_called_sure_is_right() {
    let mut draw = Draw(2026);
    let (mut sure, mut likely, mut wrong, mut likely_wrong) = (0, 0, Vec::new(), Vec::new());
    let (mut found, mut present) = (0, 0);
    for index in 0..HEADERS {
        let header = Header::generate(&mut draw, index);
        let mut text = format!("Time [s];{}", header.titles().join(";"));
        for row in 0..150 {
            // Steps of load.
            text += &format!("\n{row}{}", header.row(f64::from(row / 15 * 15) / 149.0, &mut draw));
        }
        let file = LogFile::from_bytes(Path::new("log"), text.as_bytes());
        let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
        let survey = survey(log.as_mut()).unwrap();
        let proposal = propose(log.layout(), &survey, None);
        present += header.columns.iter().filter(|(_, holds)| matches!(holds, Holds::A(_))).count();
        for proposed in &proposal.channels {
            let (name, holds) = header.columns[proposed.column];
            let unit = header_unit(proposed.unit.unwrap_or_default());
            let (_, si) = value(holds, 1.0);
            let read = unit.map_or(f64::NAN, |unit| {
                unit.unit.to_inside(header.unit_of(holds).1(si))
                    + if proposed.gauge { AMBIENT_PA } else { 0.0 }
            });
            let right = holds == Holds::A(proposed.channel) && (read / si - 1.0).abs() < 1e-3;
            found += usize::from(right && proposed.certainty > Certainty::Unsure);
            let proposal = || {
                format!(
                    "{index}: {} for {} in {:?}",
                    header.title(name, holds),
                    proposed.channel,
                    proposed.unit
                )
            };
            match proposed.certainty {
                Certainty::Sure => {
                    sure += 1;
                    wrong.extend((!right).then(proposal));
                }
                Certainty::Likely => {
                    likely += 1;
                    likely_wrong.extend((!right).then(proposal));
                }
                Certainty::Unsure => {}
            }
        }
    }
    assert!(wrong.is_empty(), "{} of {sure}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(
        100 * likely_wrong.len() <= 3 * likely,
        "{} of {likely}:\n{}",
        likely_wrong.len(),
        likely_wrong.join("\n")
    );
    // Doubting all would be no help: most of the channels are found, and half of them for sure.
    assert!(10 * found >= 7 * present && 2 * sure >= present, "{found} and {sure} of {present}");
}

fn given() -> MapDescription {
    MapDescription {
        reference: Some(ReferenceState::SAE),
        ambient_pa: Some(AMBIENT_PA),
        ..MapDescription::default()
    }
}

/// The same headers above steady points: a table is read right, or it is refused.
#[test]
fn steady_tables_are_right_or_refused() {
    let mut draw = Draw(2027);
    let (mut right, mut refused, mut wrong) = (0, Vec::new(), Vec::new());
    for index in 0..HEADERS {
        let header = Header::generate(&mut draw, index);
        let loads: Vec<f64> = (1..=6).map(|row| f64::from(row) / 6.0).collect();
        let mut text = header.titles().join(";");
        for load in &loads {
            text += &format!("\n{}", &header.row(*load, &mut Draw(0))[1..]);
        }
        let found = match read_any_text(&text, &given()) {
            Ok(found) if !found.measured.is_empty() => found,
            Ok(found) => {
                wrong.push(format!(
                    "{index}: no readings but {:?}\n{}",
                    found.columns,
                    header.titles().join(";")
                ));
                continue;
            }
            Err(error) => {
                refused.push(format!("{index}: {error}\n{}", header.titles().join(";")));
                continue;
            }
        };
        let mut is_right = found.measured.len() == loads.len();
        for (point, load) in found.measured.iter().zip(&loads) {
            for (read, channel) in [
                (Some(point.speed_rpm), ShaftSpeed),
                (Some(point.flow_kg_s), CompressorFlow),
                (Some(point.p1_pa), P1),
                (Some(point.t1_k), T1),
                (Some(point.p2_pa), P2),
                (point.t2_k, T2),
                (point.turbine.t3_k, T3),
                (point.turbine.p3_pa, P3),
                (point.turbine.p4_pa, P4),
                // Without T2 it is not used.
                (point.tc_k.filter(|_| point.t2_k.is_some()), Tc),
                (point.turbine.oil_k, TOil),
            ] {
                let (_, si) = value(Holds::A(channel), *load);
                let has = header.columns.iter().any(|(_, holds)| *holds == Holds::A(channel));
                is_right &= read.is_none_or(|read| has && (read / si - 1.0).abs() < 5e-3);
            }
        }
        if is_right {
            right += 1;
        } else {
            wrong.push(format!("{index}: {:?}\n{}", found.columns, header.titles().join(";")));
        }
    }
    assert!(wrong.is_empty(), "{} wrong, {right} right:\n{}", wrong.len(), wrong.join("\n"));
    // Refusing all would be no help. Tables without units, speed or a complete compressor are refused.
    assert!(10 * right >= 4 * HEADERS, "{right} right:\n{}", refused.join("\n"));
}

/// Headings of maps in several languages: corrected speed, corrected flow, pressure ratio, efficiency.
const MAP_HEADINGS: [[&str; 4]; 16] = [
    ["Corrected Speed", "Corrected Mass Flow", "Pressure Ratio", "Efficiency"],
    ["NcCorr", "WcCorr", "PiC", "etaC"],
    ["Speed", "Flow", "PR", "Eff"],
    ["N_red", "m_red", "pi_tt", "eta_is"],
    ["Drehzahl", "Massenstrom", "Druckverhältnis", "Wirkungsgrad"],
    ["Drehzahl korr.", "Luftmassenstrom korr.", "Druckverhältnis tt", "isentroper Wirkungsgrad"],
    ["Régime corrigé", "Débit corrigé", "Rapport de pression", "Rendement"],
    ["Velocidad corregida", "Caudal corregido", "Relación de presión", "Rendimiento"],
    ["Giri corretti", "Portata corretta", "Rapporto di pressione", "Rendimento"],
    ["Rotação", "Vazão", "Razão de pressão", "Eficiência"],
    ["Toerental", "Massastroom", "Drukverhouding", "Rendement"],
    ["Varvtal", "Massflöde", "Tryckförhållande", "Verkningsgrad"],
    ["Prędkość obrotowa", "Strumień masy", "Spręż", "Sprawność"],
    ["Приведенная частота вращения", "Приведенный расход воздуха", "Степень повышения давления", "КПД"],
    ["折合转速", "折合流量", "压比", "效率"],
    ["修正回転数", "修正流量", "圧力比", "効率"],
];

/// Units of speed and flow, and the number of a value in rpm and kg/s.
const MAP_UNITS: [[Unit; 2]; 6] = [
    [("rpm", |n| n), ("kg/s", |m| m)],
    [("1/min", |n| n), ("lb/min", |m| m / 0.453_592_37 * 60.0)],
    [("krpm", |n| n / 1e3), ("g/s", |m| m * 1e3)],
    [("rpm", |n| n), ("lb/s", |m| m / 0.453_592_37)],
    [("U/min", |n| n), ("kg/h", |m| m * 3600.0)],
    [("r/min", |n| n), ("kg/min", |m| m * 60.0)],
];

/// Columns that a map has besides, with units that no program knows.
const MORE_COLUMNS: [(&str, &str); 6] = [
    ("Torque", "Nm"),
    ("Noise", "dB(A)"),
    ("Power", "kW"),
    ("Remark", "T-T"),
    ("Fuel", "mg/str"),
    ("Tip speed", "m/s"),
];

/// Headings of maps with units in them or in a row of their own, among columns with unknown units, in any order and between any separators.
#[test]
fn maps_are_right_and_their_units_are_never_dropped() {
    let mut draw = Draw(2028);
    let (mut right, mut wrong) = (0, Vec::new());
    for index in 0..HEADERS {
        let names = MAP_HEADINGS[index % MAP_HEADINGS.len()];
        let units = MAP_UNITS[draw.below(MAP_UNITS.len())];
        let in_percent = draw.below(2) == 0;
        let (own_row, separator, bracket) =
            (draw.below(2) == 0, [";", ",", "\t"][draw.below(3)], draw.below(4));
        let mut columns: Vec<(usize, String, &str)> = vec![
            (0, names[0].to_owned(), units[0].0),
            (1, names[1].to_owned(), units[1].0),
            (2, names[2].to_owned(), ["-", "", "T-T"][draw.below(3)]),
            (3, names[3].to_owned(), if in_percent { "%" } else { "-" }),
        ];
        for _ in 0..draw.below(3) {
            let (name, unit) = MORE_COLUMNS[draw.below(MORE_COLUMNS.len())];
            let at = draw.below(columns.len() + 1);
            columns.insert(at, (4, name.to_owned(), unit));
        }
        let heading = |(_, name, unit): &(usize, String, &str)| match (own_row, *unit, bracket) {
            (true, ..) | (_, "" | "-", _) => name.clone(),
            (_, unit, 0) => format!("{name} [{unit}]"),
            (_, unit, 1) => format!("{name} ({unit})"),
            (_, unit, 2) => format!("{} / {unit}", name.to_uppercase()),
            (_, unit, _) => format!("{name} [{unit}]"),
        };
        let cell = |unit: &str| match bracket {
            0 => unit.to_owned(),
            1 => format!("[{unit}]"),
            _ => format!("({unit})"),
        };
        let mut text = columns.iter().map(heading).collect::<Vec<_>>().join(separator) + "\n";
        if own_row {
            text +=
                &(columns.iter().map(|(_, _, unit)| cell(unit)).collect::<Vec<_>>().join(separator) + "\n");
        }
        let rows = [
            [60e3, 0.05, 1.42, 0.7],
            [60e3, 0.06, 1.3, 0.68],
            [90e3, 0.07, 1.93, 0.72],
            [90e3, 0.08, 1.8, 0.71],
        ];
        for row in rows {
            let number = |(column, _, _): &(usize, String, &str)| match column {
                0 => units[0].1(row[0]).to_string(),
                1 => units[1].1(row[1]).to_string(),
                2 => row[2].to_string(),
                3 => (row[3] * if in_percent { 100.0 } else { 1.0 }).to_string(),
                _ => "7.5".to_owned(),
            };
            text += &(columns.iter().map(number).collect::<Vec<_>>().join(separator) + "\n");
        }
        let found = read_any_text(&text, &given());
        let points: Vec<[f64; 4]> = found
            .iter()
            .flat_map(|found| &found.map.lines)
            .flat_map(|line| {
                let of = |point: &mapper_core::MapPoint| {
                    [
                        line.speed_corrected_rpm,
                        point.flow_corrected_kg_s,
                        point.pressure_ratio,
                        point.eta.unwrap_or(f64::NAN),
                    ]
                };
                line.points.iter().map(of).collect::<Vec<_>>()
            })
            .collect();
        let is_right = points.len() == 4
            && points.iter().flatten().zip(rows.iter().flatten()).all(|(a, b)| (a / b - 1.0).abs() < 1e-9);
        match is_right {
            true => right += 1,
            false => wrong.push(format!("{index}: {:?} {points:?}\n{text}", found.err())),
        }
    }
    assert!(wrong.is_empty(), "{} of {HEADERS}:\n{}", wrong.len(), wrong.join("\n"));
    assert_eq!(right, HEADERS);
}
