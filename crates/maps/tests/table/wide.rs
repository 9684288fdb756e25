//! Tables with a group of columns for each speed line.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{MapDescription, ReferenceState};
use mapper_maps::table::{read_any_text, text_of_lines};

/// Speed, flow, pressure ratio and efficiency of every point.
pub fn points(text: &str) -> Vec<[Option<f64>; 4]> {
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    let map = read_any_text(text, &given).unwrap_or_else(|error| panic!("{error}\n{text}")).map;
    let of_line = |line: &mapper_core::SpeedLine| {
        let speed = Some(line.speed_corrected_rpm);
        let values =
            |p: &mapper_core::MapPoint| [speed, Some(p.flow_corrected_kg_s), Some(p.pressure_ratio), p.eta];
        line.points.iter().map(values).collect::<Vec<_>>()
    };
    map.lines.iter().flat_map(of_line).collect()
}

pub const FOUR: [[f64; 4]; 4] =
    [[6e4, 0.05, 1.4, 0.7], [6e4, 0.06, 1.3, 0.68], [9e4, 0.06, 1.9, 0.72], [9e4, 0.07, 1.8, 0.71]];

#[test]
fn speeds_in_the_headings_make_one_map() {
    let expected: Vec<[Option<f64>; 4]> = FOUR.iter().map(|row| row.map(Some)).collect();
    for text in [
        "flow [kg/s],PR@60000,eta@60000,PR@90000,eta@90000\n0.05,1.4,0.7,,\n0.06,1.3,0.68,1.9,0.72\n0.07,,,1.8,0.71\n",
        "60000 rpm | flow [kg/s],60000 rpm | PR,60000 rpm | eta,90000 rpm | flow [kg/s],90000 rpm | PR,90000 rpm | eta\n\
         0.05,1.4,0.7,0.06,1.9,0.72\n0.06,1.3,0.68,0.07,1.8,0.71\n",
        "m_60krpm (g/s);m_90krpm (g/s);PR_60krpm;PR_90krpm;eta_60krpm (%);eta_90krpm (%)\n50;60;1,4;1,9;70;72\n60;70;1,3;1,8;68;71\n",
        ";60 krpm;;90 krpm;\nMassenstrom;Druckverhältnis;Wirkungsgrad;Druckverhältnis;Wirkungsgrad\nkg/s;-;%;-;%\n\
         0,05;1,4;70;;\n0,06;1,3;68;1,9;72\n0,07;;;1,8;71\n",
        "N=60000,,,N=90000,,\nflow,PR,eta,flow,PR,eta\ng/s,-,-,g/s,-,-\n50,1.4,0.7,60,1.9,0.72\n60,1.3,0.68,70,1.8,0.71\n",
    ] {
        // Conversions of units round.
        let rounded = |rows: Vec<[Option<f64>; 4]>| -> Vec<[Option<f64>; 4]> {
            rows.into_iter()
                .map(|row| row.map(|value| value.map(|value| (1e9 * value).round() / 1e9)))
                .collect()
        };
        assert_eq!(rounded(points(text)), expected, "{text}");
    }
}

/// A matrix of pressure ratios over flow, its speeds as headings.
#[test]
fn a_matrix_has_the_quantity_of_its_title() {
    let text = "Total pressure ratio\nflow [kg/s],60000,90000\n0.05,1.4,\n0.06,1.3,1.9\n0.07,,1.8\n";
    let expected: Vec<[Option<f64>; 4]> =
        FOUR.iter().map(|[n, m, ratio, _]| [Some(*n), Some(*m), Some(*ratio), None]).collect();
    assert_eq!(points(text), expected);
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    let untitled = text.split_once('\n').unwrap().1;
    assert!(read_any_text(untitled, &given).is_err(), "it may be of efficiencies");
}

/// Four points as spreadsheets, reports and data systems of several countries have them.
#[test]
fn tables_as_they_are_exported() {
    let expected: Vec<[Option<f64>; 4]> = FOUR.iter().map(|row| row.map(Some)).collect();
    for text in [
        // In Chinese, Russian and Japanese.
        "压气机特性图\n转速(r/min),流量(kg/s),压比,效率\n60000,0.05,1.4,0.7\n60000,0.06,1.3,0.68\n90000,0.06,1.9,0.72\n90000,0.07,1.8,0.71\n",
        "Частота вращения, об/мин;Расход воздуха, кг/с;Степень повышения давления;КПД\n60000;0,05;1,4;0,7\n60000;0,06;1,3;0,68\n90000;0,06;1,9;0,72\n90000;0,07;1,8;0,71\n",
        "回転数 [rpm]\t空気流量 [kg/s]\t圧力比\t効率\n60000\t0.05\t1.4\t0.7\n60000\t0.06\t1.3\t0.68\n90000\t0.06\t1.9\t0.72\n90000\t0.07\t1.8\t0.71\n",
        // Measured and corrected, static and total, of engine and turbine.
        "MP,N [rpm],N_corr [rpm],Engine speed [rpm],m [kg/s],m_corr [kg/s],PR_ts,PR_tt,Turbine eff,eta_ts,eta_tt\n\
         1,58000,60000,1500,0.04,0.05,1.3,1.4,0.5,0.6,0.7\n2,58000,60000,1500,0.05,0.06,1.2,1.3,0.5,0.6,0.68\n\
         3,88000,90000,1500,0.05,0.06,1.8,1.9,0.5,0.6,0.72\n4,88000,90000,1500,0.06,0.07,1.7,1.8,0.5,0.6,0.71\n",
        // With a mean and the author below, and with an overload outside the map's quantities.
        "Speed,Flow,PR,Eff,T oil\n60000,0.05,1.4,0.7,OL\n60000,0.06,1.3,0.68,90\n90000,0.06,1.9,0.72,#DIV/0!\n90000,0.07,1.8,0.71,91\n\n\
         Mean,,,0.7,\nMade by A. Smith on 3/4/2025\n",
        "Régime (tr/min);Débit (kg/s);Rapport de pression;Rendement\n60\u{202f}000;0,05;1,4;0,7\n60 000;0,06;1,3;0,68\n90 000;0,06;1,9;0,72\n\
         90\u{a0}000;0,07;1,8;0,71\n",
        // Of a text document.
        "| speed rpm | flow kg/s | PR | eta |\n|---|---|---|---|\n| 60000 | 0.05 | 1.4 | 0.7 |\n| 60000 | 0.06 | 1.3 | 0.68 |\n\
         | 90000 | 0.06 | 1.9 | 0.72 |\n| 90000 | 0.07 | 1.8 | 0.71 |\n",
        "N/√θ [rpm],W√θ/δ [kg/s],P2/P1,η\n60000,0.05,1.4,0.7\n60000,0.06,1.3,0.68\n90000,0.06,1.9,0.72\n90000,0.07,1.8,0.71\n",
        "Speed 60,000 RPM\nCorrected Air Flow (kg/s)   Pressure Ratio (P2c/P1c)   Efficiency\n0.05   1.4   0.7\n0.06   1.3   0.68\n\
         Speed 90,000 RPM\nCorrected Air Flow (kg/s)   Pressure Ratio (P2c/P1c)   Efficiency\n0.06   1.9   0.72\n0.07   1.8   0.71\n",
    ] {
        assert_eq!(points(text), expected, "{text}");
    }
}

/// The lines PR = 2 - 5 m and PR = 3 - 5 m cross the contours at m = 0.1 (70 %), which is upright, and PR = 5 m + 1 (75 %), a diagonal.
#[test]
fn contours_give_the_efficiencies_where_they_cross_the_lines() {
    let file = |name: &str, text: &str| (name.to_owned(), text.as_bytes().to_vec());
    for (heading, eta) in [("", "eta_0.70"), ("flow [kg/s],PR\n", "70%")] {
        let files = [
            file("60000", &format!("{heading}0.02,1.9\n0.18,1.1\n")),
            file("90000", &format!("{heading}0.02,2.9\n0.3,1.5\n")),
            file(eta, "0.1,1.05\n0.1,2.8\n"),
            file("eff 75", "0,1\n0.15,1.75\n0.3,2.5\n"),
        ];
        let text = text_of_lines(&files).unwrap();
        let text = text.replace("Q,", "flow [kg/s],");
        let found: Vec<[Option<f64>; 4]> = points(&text).into_iter().filter(|row| row[3].is_some()).collect();
        // 2 - 5 m = 5 m + 1 at 0.1, where both contours meet; 3 - 5 m at 0.2.
        let expected =
            [[6e4, 0.1, 1.5, 0.7], [6e4, 0.1, 1.5, 0.75], [9e4, 0.1, 2.5, 0.7], [9e4, 0.2, 2.0, 0.75]];
        assert_eq!(found.len(), 4, "{text}");
        for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((a.unwrap() - b).abs() < 1e-9, "{found:?}");
        }
    }
    assert!(text_of_lines(&[file("notes", "0.1,1.2\n")]).is_err());
}
