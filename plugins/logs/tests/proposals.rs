//! Channels that a log suggests: what physics contradicts is never sure.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::Channel;
use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::proposal::{Ambient, Certainty, NominalFlows, Proposal, ProposalRemark, propose};
use mapper_recording::logs::{LogFile, LogOptions, survey};
use std::path::Path;

/// A log of two minutes at 1 Hz with these headings; `row` has the values at a load of 0 to 1.
fn proposal(headings: &str, row: impl Fn(f64) -> Vec<f64>) -> Proposal {
    proposal_for(headings, None, row)
}

/// The same of a machine with known flows.
fn proposal_for(
    headings: &str,
    nominal: Option<NominalFlows<'_>>,
    row: impl Fn(f64) -> Vec<f64>,
) -> Proposal {
    let mut text = format!("Time [s],{headings}\n");
    for second in 0..120 {
        let load = f64::from(second) / 119.0;
        let values: Vec<String> = row(load).iter().map(f64::to_string).collect();
        text += &format!("{second},{}\n", values.join(","));
    }
    let file = LogFile::from_bytes(Path::new("log"), text.as_bytes());
    let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    let found = survey(log.as_mut()).unwrap();
    propose(log.layout(), &found, nominal)
}

fn sure(proposal: &Proposal) -> Vec<Channel> {
    let sure = proposal.channels.iter().filter(|proposed| proposed.certainty == Certainty::Sure);
    sure.map(|proposed| proposed.channel).collect()
}

/// The stations 2 to 5 of a gas turbine: the temperature rises from 3 to 4, where the combustor is. They are renumbered, never surely.
#[test]
fn stations_of_a_gas_turbine_are_renumbered() {
    let found = proposal("P2 [kPa],T2 [K],P3 [kPa],T3 [K],P4 [kPa],T4 [K],P5 [kPa],T5 [K]", |load| {
        let ratio = 1.0 + 1.3 * load;
        vec![98.0, 295.0, 98.0 * ratio, 295.0 + 110.0 * load, 97.0 * ratio, 500.0 + 300.0 * load, 99.0, 450.0]
    });
    assert_eq!(sure(&found), []);
    let column = |channel: Channel| found.entry(channel).map(|found| (found.column, found.certainty));
    let likely = |column: usize| Some((column, Certainty::Likely));
    assert_eq!([Channel::P1, Channel::T1, Channel::P2, Channel::T2].map(column), [0, 1, 2, 3].map(likely));
    assert_eq!([Channel::P3, Channel::T3, Channel::P4, Channel::T4].map(column), [4, 5, 6, 7].map(likely));
    // Without the fifth station nothing says that it is so.
    let found = proposal("P2 [kPa],T2 [K],P3 [kPa],T3 [K],P4 [kPa],T4 [K]", |load| {
        let ratio = 1.0 + 1.3 * load;
        vec![98.0, 295.0, 98.0 * ratio, 295.0 + 110.0 * load, 97.0 * ratio, 500.0 + 300.0 * load]
    });
    assert!(found.channels.iter().all(|proposed| proposed.certainty == Certainty::Unsure));
    // Other names, with a shaft speed and a flow that have numbers of their own.
    let names = "N1 [rpm],W2 [kg/s],Tt2_degC,Tt3_degC,Tt4_degC,Tt5_degC,Pt2_kPa,Pt3_kPa";
    let found = proposal(names, |load| {
        vec![
            20e3 + 90e3 * load,
            0.02 + 0.13 * load,
            22.0,
            22.0 + 110.0 * load,
            500.0,
            420.0,
            98.0,
            98.0 + 130.0 * load,
        ]
    });
    let of = |channel: Channel| found.entry(channel).map(|found| found.column);
    assert_eq!(of(Channel::ShaftSpeed).zip(of(Channel::CompressorFlow)), Some((0, 1)));
    assert_eq!([Channel::T1, Channel::T4, Channel::P2].map(of), [Some(2), Some(5), Some(7)]);
    // The same values under the stations of a turbocharger.
    let found = proposal("P1 [kPa],T1 [K],P2 [kPa],T2 [K],P3 [kPa],T3 [K],P4 [kPa],T4 [K]", |load| {
        let ratio = 1.0 + 1.3 * load;
        vec![98.0, 295.0, 98.0 * ratio, 295.0 + 110.0 * load, 97.0 * ratio, 500.0 + 300.0 * load, 99.0, 450.0]
    });
    assert!(sure(&found).contains(&Channel::T3) && sure(&found).contains(&Channel::T2));
}

/// An engine's speed and throttle are not those of the turbocharger and of the valve behind its compressor.
#[test]
fn an_engines_speed_and_throttle_are_not_taken() {
    let found = proposal("RPM [rpm],Throttle Pos. [%],Flow [g/s]", |load| {
        vec![1500.0 + 4200.0 * load, 20.0 + 77.0 * load, 10.0 + 140.0 * load]
    });
    assert!(!sure(&found).contains(&Channel::ShaftSpeed));
    assert!(found.entry(Channel::ValveCommand).is_none());
    let found = proposal("RPM [rpm],Flow [g/s]", |load| vec![15e3 + 100e3 * load, 10.0 + 140.0 * load]);
    assert!(sure(&found).contains(&Channel::ShaftSpeed));
}

/// Inches of water are a pressure, and a barometer in inches of mercury is the ambient pressure.
#[test]
fn american_pressures_are_known() {
    let found =
        proposal("Baro [inHg],Comp Inlet Press [inH2O],T1 [F]", |load| vec![29.12, -7.9 * load, 72.0]);
    assert!(found.entry(Channel::P1).is_some_and(|inlet| inlet.gauge) && found.ambient.is_some());
}

/// A flow with its unit is as sure as its name; one without gets the unit that fits the wheel.
#[test]
fn a_flow_keeps_its_unit() {
    let row = |load: f64| vec![30e3 + 90e3 * load, 0.03 + 0.12 * load, 99.0, 105.0 + 130.0 * load];
    let found = proposal("n_TC [rpm],m_dot_C [kg/s],p1_C [kPa],p2_C [kPa]", row);
    assert!(sure(&found).contains(&Channel::CompressorFlow));
    let found = proposal("n_TC [rpm],m_dot_C,p1_C [kPa],p2_C [kPa]", row);
    let flow = found.entry(Channel::CompressorFlow).unwrap();
    assert_eq!((flow.unit, flow.certainty), (Some("kg/s"), Certainty::Likely));
}

/// The station may stand behind total or static, and a volume flow is named by its unit alone.
#[test]
fn totals_with_a_station_and_volume_flows_are_understood() {
    let found = proposal("Tstat2 [K],Ttot2 [K],p_tot_1 [kPa],Q [Nm3/min]", |load| {
        vec![297.0 + 100.0 * load, 300.0 + 100.0 * load, 98.0, 1.0 + 5.0 * load]
    });
    let column = |channel: Channel| found.entry(channel).map(|found| found.column);
    assert_eq!([Channel::T2, Channel::P1].map(column), [Some(1), Some(2)]);
    let named = |remark: &ProposalRemark| matches!(remark, ProposalRemark::StandardFlow { column, .. } if column == "Q");
    assert!(found.remarks.iter().any(named), "{:?}", found.remarks);
}

/// `T_c` is the gas if it is hotter than an ideal compression makes it, and cannot be if it is cooler.
#[test]
fn a_temperature_without_a_place_is_judged_by_the_pressure() {
    // At 2.3 bar an ideal compression from 22 degC ends at 101 degC.
    for (top_degc, channel) in [(135.0, Channel::T2), (70.0, Channel::Tc)] {
        let found = proposal("n [rpm],p_c [kPa],T1 [degC],T_c [degC]", |load| {
            vec![20e3 + 90e3 * load, 99.0 + 131.0 * load, 22.0, 22.0 + (top_degc - 22.0) * load]
        });
        assert_eq!(found.entry(channel).map(|found| found.column), Some(3), "{top_degc}");
        assert_eq!(
            found.entry(Channel::P2).map(|found| (found.column, found.certainty)),
            Some((1, Certainty::Likely))
        );
        assert!(!sure(&found).contains(&channel));
    }
}

/// 548 without a unit may be g/s, kg/h or lb/min; the machine of the log passes 0.1 to 0.2 kg/s.
#[test]
fn the_machine_settles_the_unit_of_a_flow() {
    let row = |load: f64| vec![30e3 + 90e3 * load, 548.0 * load, 99.0, 105.0 + 130.0 * load];
    let names = "n_TC [rpm],m_dot_C,p1_C [kPa],p2_C [kPa]";
    let unit = |flows: Option<NominalFlows<'_>>| {
        let found = proposal_for(names, flows, row);
        let flow = found.entry(Channel::CompressorFlow).unwrap();
        (flow.certainty, flow.unit)
    };
    assert_eq!(unit(None).0, Certainty::Unsure);
    assert_eq!(unit(Some(&|_| (0.1, 0.2))), (Certainty::Likely, Some("kg/h")));
    assert_eq!(unit(Some(&|_| (0.4, 0.7))), (Certainty::Likely, Some("g/s")));
    assert_eq!(unit(Some(&|_| (30.0, 40.0))).0, Certainty::Unsure);
}

/// Names below a group of the machine, in German.
#[test]
fn a_machine_before_the_quantity_is_understood() {
    let names = "Verdichter Druck ein [kPa],Verdichter Druck aus [kPa],Verdichter Temperatur aus [degC],Turbine Druck ein [kPa],Turbine Temperatur aus [degC]";
    let found = proposal(names, |load| {
        vec![98.0, 98.0 + 130.0 * load, 22.0 + 110.0 * load, 99.0 + 100.0 * load, 400.0]
    });
    let of = |channel: Channel| found.entry(channel).map(|found| found.column);
    let channels = [Channel::P1, Channel::P2, Channel::T2, Channel::P3, Channel::T4];
    assert_eq!(channels.map(of), [0, 1, 2, 3, 4].map(Some));
}

/// pandas numbers the second of two equal names; the number is not a station.
#[test]
fn a_number_behind_a_point_is_no_station() {
    let found = proposal("Pressure [kPa],Temp [degC],Pressure.1 [kPa],Temp.1 [degC]", |load| {
        vec![98.0, 22.0, 98.0 + 130.0 * load, 22.0 + 110.0 * load]
    });
    assert_eq!(found.channels, []);
}

/// 72 degF at the inlet; taken for degC no room would be as warm.
#[test]
fn imperial_logs_have_imperial_temperatures() {
    let names =
        "turbo_speed [rpm],comp_inlet_press [psia],comp_outlet_press [psia],comp_inlet_temp,comp_outlet_temp";
    let row = |load: f64| vec![1e5 * load, 14.3, 14.3 + 19.0 * load, 72.0 + load, 73.0 + 200.0 * load];
    let found = proposal(names, row);
    for channel in [Channel::T1, Channel::T2] {
        let proposed = found.entry(channel).unwrap();
        assert_eq!((proposed.unit, proposed.certainty), (Some("degF"), Certainty::Likely), "{channel}");
    }
}

/// A tag number has the quantity and no place. Loops with a temperature and a pressure are placed if only one order is a compressor;
/// else they are named with the remedy.
#[test]
fn tag_numbers_are_never_sure() {
    let row = |load: f64| {
        vec![20e3 + 90e3 * load, 0.02 + 0.13 * load, 98.0, 22.0, 98.0 + 130.0 * load, 22.0 + 110.0 * load]
    };
    for names in [
        "SE-101 [rpm],FT-3 [kg/s],PT-101 [kPa],TT-101 [degC],PT-102 [kPa],TT-102 [degC]",
        "ST_2101 [rpm],FIT 2101 [kg/s],PIT_2101A [kPa],TE_2101 [degC],PIT_2102A [kPa],TE_2102 [degC]",
    ] {
        let found = proposal(names, row);
        let likely = |channel: Channel| found.entry(channel).map(|found| (found.column, found.certainty));
        assert_eq!(likely(Channel::ShaftSpeed), Some((0, Certainty::Likely)), "{names}");
        assert_eq!(likely(Channel::CompressorFlow), Some((1, Certainty::Likely)), "{names}");
        let places = [Channel::P1, Channel::T1, Channel::P2, Channel::T2];
        assert_eq!(
            places.map(likely),
            [2, 3, 4, 5].map(|column| Some((column, Certainty::Likely))),
            "{names}"
        );
        // A rise of 15 K at 2.3 bar would be an efficiency of 5.
        let found = proposal(names, |load| {
            let mut row = row(load);
            row[5] = 22.0 + 15.0 * load;
            row
        });
        assert_eq!(found.channels.len(), 2, "{names}");
        let named = |remark: &ProposalRemark| matches!(remark, ProposalRemark::TagNumbers { columns } if columns.len() == 4);
        assert!(found.remarks.iter().any(named), "{names}");
    }
    // Compressor, turbine and oil in any order of the numbers.
    let names = "TI1104 [degC],PI1104 [kPa],TI1101 [degC],PI1101 [bar g],TI1150 [degC],PI1150 [kPa],TI1103 [degC],PI1103 [kPa],TI1102 [degC],PI1102 [kPa]";
    let found = proposal(names, |load| {
        let (t2_degc, p2_kpa) = (22.0 + 110.0 * load, 98.0 + 130.0 * load);
        let (t3_degc, p3_kpa) = (500.0 + 100.0 * load, 100.0 + 115.0 * load);
        let t4_degc = t3_degc - 80.0 * load;
        vec![t4_degc, 99.0, 22.0, -0.033, 75.0, 300.0, t3_degc, p3_kpa, t2_degc, p2_kpa]
    });
    let column = |channel: Channel| found.entry(channel).map(|found| found.column);
    let places = [
        Channel::T1,
        Channel::P1,
        Channel::T2,
        Channel::P2,
        Channel::T3,
        Channel::P3,
        Channel::T4,
        Channel::P4,
    ];
    assert_eq!(places.map(column), [2, 3, 8, 9, 6, 7, 0, 1].map(Some));
    assert_eq!(sure(&found), []);
    // A total pressure and temperature with their usual numbers are not tags.
    let found = proposal("PT1 [kPa],PT2 [kPa],TT1 [degC],TT2 [degC]", |load| row(load)[2..].to_vec());
    assert_eq!(found.remarks.iter().filter(|remark| remark.code() == "tag_numbers").count(), 0);
}

/// Chinese names, as spreadsheets in China write them: in the encoding GBK.
#[test]
fn chinese_names_are_read_in_their_encoding() {
    let mut text =
        "时间(s),转速(r/min),流量(kg/h),进口压力(kPa),进口温度(℃),出口压力(kPa),出口温度(℃)\n".to_owned();
    for second in 0..120 {
        let load = f64::from(second) / 119.0;
        let (speed, flow) = (20e3 + 90e3 * load, 80.0 + 460.0 * load);
        text += &format!("{second},{speed},{flow},98,22,{},{}\n", 98.0 + 130.0 * load, 22.0 + 110.0 * load);
    }
    let (bytes, _, _) = encoding_rs::GBK.encode(&text);
    for bytes in [text.as_bytes(), &bytes] {
        let file = LogFile::from_bytes(Path::new("log"), bytes);
        let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
        let found = survey(log.as_mut()).unwrap();
        let found = propose(log.layout(), &found, None);
        let channels: Vec<Channel> = found.channels.iter().map(|proposed| proposed.channel).collect();
        use Channel::{CompressorFlow, P1, P2, ShaftSpeed, T1, T2};
        assert_eq!(channels, [ShaftSpeed, CompressorFlow, P1, T1, P2, T2]);
        // The others name no machine.
        assert!(sure(&found).iter().all(|channel| *channel == ShaftSpeed), "{:?}", sure(&found));
    }
}

/// P1 falls with the load, so that the first digit of `P11` and `P21` is the station.
#[test]
fn the_first_reading_of_a_station_is_no_other_station() {
    for names in [
        "P21 [bar],P11 [bar],T21 [degC],T11 [degC],N [rpm]",
        "p_21 [bar],p_11 [bar],T_21 [degC],T_11 [degC],N [rpm]",
        "P21 [bar],P1 [bar],T21 [degC],T11 [degC],N [rpm]",
    ] {
        let found = proposal(names, |load| {
            vec![1.01 + 1.9 * load, 1.01 - 0.02 * load, 22.0 + 120.0 * load, 22.0, 110e3 * load]
        });
        let column = |channel: Channel| found.entry(channel).map(|found| found.column);
        let found = [Channel::P1, Channel::P2, Channel::T1, Channel::T2].map(column);
        assert_eq!(found, [Some(1), Some(0), Some(3), Some(2)], "{names}");
    }
}

/// T1 of 18 to 20 degC and T2 to 160 degC in both units; without T1 both remain possible.
#[test]
fn fahrenheit_is_a_possible_unit_of_a_log_without_units() {
    let fahrenheit = |celsius: f64| 32.0 + 1.8 * celsius;
    let unit = |found: &Proposal, channel: Channel| {
        found.entry(channel).map(|found| (found.unit.unwrap(), found.certainty))
    };
    for is_fahrenheit in [false, true] {
        let written = |celsius: f64| if is_fahrenheit { fahrenheit(celsius) } else { celsius };
        let found = proposal("CompInTemp,CompOutTemp,TurbInTemp,CompInPress,CompOutPress", |load| {
            let temperatures = [20.0 - 2.0 * load, 22.0 + 138.0 * load, 60.0 + 480.0 * load].map(written);
            [temperatures.as_slice(), &[14.6 - 0.2 * load, 14.6 + 28.0 * load]].concat()
        });
        let symbol = if is_fahrenheit { "degF" } else { "degC" };
        for channel in [Channel::T1, Channel::T2, Channel::T3] {
            assert_eq!(unit(&found, channel), Some((symbol, Certainty::Likely)));
        }
        let found = proposal("CompOutTemp,TurbInTemp", |load| {
            vec![written(22.0 + 138.0 * load), written(60.0 + 480.0 * load)]
        });
        for channel in [Channel::T2, Channel::T3] {
            assert_eq!(unit(&found, channel).map(|(_, certainty)| certainty), Some(Certainty::Unsure));
        }
    }
}

/// A flow of 0.1 lb/s is 0.045 kg/s: speed and pressure ratio cannot tell them apart, the unit of the pressures can.
#[test]
fn a_flow_without_unit_has_the_system_of_the_pressures() {
    for (unit, scale, flow, expected) in [("psi", 14.504, 0.1, "lb/s"), ("bar", 1.0, 0.045, "kg/s")] {
        let names = format!("N [rpm],MassFlow,P1 [{unit}],P2 [{unit}]");
        let found = proposal(&names, |load| {
            vec![20e3 + 100e3 * load, flow * (0.2 + load), scale, scale * (1.05 + 1.2 * load)]
        });
        let proposed = found.entry(Channel::CompressorFlow).unwrap();
        assert_eq!((proposed.unit, proposed.certainty), (Some(expected), Certainty::Likely));
    }
}

/// The clock of a second run begins again at 0 s in row 61.
#[test]
fn a_second_run_in_the_file_is_found_by_the_survey() {
    let mut text = "Time [s],T1 [K],T2 [K]\n".to_owned();
    for second in (0..60).chain(0..40) {
        text += &format!("{second},295,{}\n", 300 + second);
    }
    let file = LogFile::from_bytes(Path::new("log"), text.as_bytes());
    let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    let restart = survey(log.as_mut()).unwrap().groups[0].restart.unwrap();
    assert_eq!((restart.row, restart.from_s, restart.to_s), (61, 59.0, 0.0));
}

/// A whole log whose one channel has this heading. Gauge pressures, if the heading is that of the barometer.
fn with_heading(channel: Option<Channel>, heading: &str) -> Proposal {
    let gauge = if channel.is_none() { "(g)" } else { "" };
    let columns = [
        (Channel::ShaftSpeed, "Turbo speed [rpm]".to_owned(), 20e3, 118e3),
        (Channel::CompressorFlow, "Air mass flow [kg/s]".to_owned(), 0.011, 0.152),
        (Channel::P1, "Compressor inlet pressure [kPa]".to_owned(), 98.6, 96.7),
        (Channel::T1, "Compressor inlet temperature [degC]".to_owned(), 22.0, 23.0),
        (Channel::P2, format!("Compressor outlet pressure [kPa{gauge}]"), 103.0, 232.0),
        (Channel::T2, "Compressor outlet temperature [degC]".to_owned(), 28.0, 134.0),
        (Channel::P3, "Turbine inlet pressure [kPa]".to_owned(), 102.0, 217.0),
        (Channel::T3, "Turbine inlet temperature [degC]".to_owned(), 290.0, 525.0),
        (Channel::P4, "Turbine outlet pressure [kPa]".to_owned(), 98.9, 100.2),
        (Channel::T4, "Turbine outlet temperature [degC]".to_owned(), 270.0, 447.0),
        (Channel::TOil, "Oil inlet temperature [degC]".to_owned(), 61.0, 70.0),
    ];
    let own = |known: Channel, name: &String| {
        let (_, unit) = name.rsplit_once('[').unwrap();
        if Some(known) == channel { format!("{heading} [{unit}") } else { name.clone() }
    };
    let mut names: Vec<String> = columns.iter().map(|(known, name, ..)| own(*known, name)).collect();
    names.extend(channel.is_none().then(|| format!("{heading} [mbar]")));
    proposal(&names.join(","), |load| {
        // Steps, with a small movement of their own.
        let load = (8.0 * load).floor() / 8.0 + 1e-3 * (100.0 * load).sin();
        let value = |(known, _, low, high): &(Channel, String, f64, f64)| {
            let gauge_kpa = if channel.is_none() && *known == Channel::P2 { 98.7 } else { 0.0 };
            low + (high - low) * load - gauge_kpa
        };
        columns.iter().map(value).chain(channel.is_none().then_some(987.0 + load)).collect()
    })
}

/// Barometers in eleven languages: gauge pressures are over them.
#[test]
fn barometers_of_other_languages_are_known() {
    for heading in [
        "Omgivningstryck",
        "Lufttryck",
        "Omgevingsdruk",
        "Atmosferische druk",
        "Барометрическое давление",
        "Атмосферное давление",
        "大気圧",
        "気圧",
        "大气压力",
        "Ciśnienie otoczenia",
        "Ciśnienie atmosferyczne",
        "Pressione atmosferica",
        "Pressão atmosférica",
        "Pression atmosphérique",
        "Presión barométrica",
        "Umgebungsdruck",
        "Atmosférický tlak",
        "P0",
        "P_0",
        "PBAR",
        "p_amb",
    ] {
        let found = with_heading(None, heading);
        assert!(matches!(found.ambient, Some(Ambient::Column { column: 11, .. })), "{heading}");
    }
}

/// Short names and names in other languages; a name with a second meaning is proposed, but not as sure.
#[test]
fn names_of_other_programs_and_languages_are_known() {
    let certain = |channel: Channel, heading: &str| {
        let found = with_heading(Some(channel), heading);
        found.entry(channel).map(|entry| entry.certainty)
    };
    for (channel, headings) in [
        (
            Channel::CompressorFlow,
            &[
                "MFAIR",
                "FM_AIR",
                "Przepływ masy powietrza",
                "Strumień masy powietrza",
                "空気流量",
                "Luchtdebiet",
            ][..],
        ),
        (Channel::P3, &["涡前压力", "タービン入口圧力", "Ciśnienie przed turbiną"]),
        (Channel::T3, &["涡前温度", "Temperatur före turbin"]),
        (Channel::T4, &["涡后温度", "Temperatuur na turbine"]),
        (Channel::ShaftSpeed, &["過給機回転数", "Обороты ТКР", "Läuferdrehzahl", "Spool Speed", "N_gg"]),
        (Channel::TOil, &["Olietemperatuur", "Oljetemperatur", "油温"]),
        (Channel::P1, &["压前压力", "Inlet Pressure P1"]),
        (Channel::T1, &["Inlet Temperature T1"]),
        (Channel::P2, &["Compressor Exit Pressure P2"]),
    ] {
        for heading in headings {
            assert_eq!(certain(channel, heading), Some(Certainty::Sure), "{heading}");
        }
    }
    for (channel, headings) in [
        (Channel::P1, &["P_suc", "入口圧", "Inlaatdruk", "Suction pressure"][..]),
        (Channel::T1, &["T_suc", "吸入空気温度"]),
        (Channel::P2, &["P_dis", "過給圧", "Ciśnienie doładowania", "Laddtryck"]),
        (Channel::T2, &["T_dis", "Charge air temp before intercooler", "Temperatur vor Ladeluftkühler"]),
        (Channel::P3, &["Exhaust back pressure pre turbo"]),
        (Channel::T3, &["排气温度", "EGT pre turbo"]),
    ] {
        for heading in headings {
            assert_eq!(certain(channel, heading), Some(Certainty::Likely), "{heading}");
        }
    }
    // Behind the cooler it is another temperature.
    assert!(
        with_heading(Some(Channel::T2), "Charge air temp after intercooler").entry(Channel::T2).is_none()
    );
}
