//! Pages that the program writes, in a browser.

use mapper_tests::{CampaignFile, mapper, only_run, repository, scratch};
use std::process::Command;

/// A rig with a probe that conducts along its stem, four points of it.
const FOUR_POINTS_AND_AN_EFFECT: &[(&str, &str)] = &[
    (
        "speeds: [90 krpm, 150 krpm, 50 krpm, 130 krpm, 70 krpm, 110 krpm]",
        "speeds: [90 krpm, 150 krpm, 60 krpm, 120 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0]", "openings: [0.9]"),
    ("dwell: 120 s", "dwell: 60 s"),
    ("end: 110 s}", "end: 55 s}"),
    ("    weather: wandering\n", "    weather: wandering\n    effects: {stem_conduction: 8 %}\n"),
];

#[test]
#[cfg_attr(not(with_chromium), ignore = "needs Chromium: run `cargo xtask test`")]
fn a_diagnosis_opens_in_a_browser_with_all_its_pictures() {
    let shipped = std::fs::read_to_string(repository().join("campaigns/gap_rig.yaml")).unwrap();
    let text = FOUR_POINTS_AND_AN_EFFECT.iter().fold(shipped, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let campaign = CampaignFile::of(text);
    mapper(["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), campaign.runs().as_os_str()])
        .exits(0);
    let scratch = scratch();
    let page = scratch.path().join("gap.html");
    let diagnosed = mapper([
        "gap".as_ref(),
        "diagnose".as_ref(),
        campaign.path.as_os_str(),
        "--recording".as_ref(),
        only_run(&campaign.runs()).as_os_str(),
        "--json".as_ref(),
        "--html".as_ref(),
        page.as_os_str(),
    ])
    .exits(0);
    // The rig's backend settings are truth, which the diagnosis does not read: it has to find the effect.
    let found = &diagnosed.json()["candidates"][0]["effects"];
    assert_eq!(*found, serde_json::json!(["stem_conduction"]), "{}", diagnosed.stdout);

    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let browsed = Command::new(chromium)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", scratch.path().join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    let (dom, said) = (String::from_utf8_lossy(&browsed.stdout), String::from_utf8_lossy(&browsed.stderr));
    assert!(browsed.status.success(), "{said}");
    assert!(!said.contains("CONSOLE"), "the page complains: {said}");
    // The map of where, and the traces; the parser of a browser leaves out what is no SVG.
    assert_eq!(dom.matches("<svg").count(), 2, "{dom}");
    assert!(dom.matches("<polyline").count() + dom.matches("<path").count() > 8);
    for heading in [
        "Which",
        "Where",
        "Residuals without the cause",
        "Residuals with the first cause",
        "Before and after",
    ] {
        assert!(dom.contains(&format!("<h2>{heading}")), "{heading}");
    }
    // It needs nothing but itself.
    assert!(!dom.contains("src=\"http") && !dom.contains("href=\"http"));
}
