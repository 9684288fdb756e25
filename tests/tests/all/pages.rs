//! Pages that the program writes, in a browser.

use mapper_tests::{CampaignFile, mapper, mapper_command, only_run, python, repository, scratch};
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

    // The same on the page of the run.
    let whole = scratch.path().join("run.html");
    let run = only_run(&campaign.runs());
    let arguments = ["report".as_ref(), run.as_os_str(), "--gap".as_ref(), campaign.path.as_os_str()];
    mapper(arguments.into_iter().chain(["-o".as_ref(), whole.as_os_str()])).exits(0);
    let text = std::fs::read_to_string(whole).unwrap();
    let section = text.split("id=\"gap\"").nth(1).unwrap();
    assert!(section.contains("(stem_conduction) explains the gap") && section.matches("<svg").count() == 2);
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

/// Nine points of turbo_a with repeats, without a soak; the operator's name is markup.
const NINE_POINTS: &[(&str, &str)] = &[
    (
        "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
        "speeds: [80 krpm, 110 krpm, 140 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.0, 1.4]"),
    ("warm_up: 2 min ", "warm_up: 60 s "),
    ("zero: {soak: 30 min, evenness: 0.01 K, pressure_evenness: 1 Pa}\n", ""),
    ("operator: virtual\n", "operator: '</script><img src=x onerror=alert(1)>'\n"),
];

/// A run of them: its campaign, which goes away with the returned value, and its directory.
fn run_of_nine_points() -> (CampaignFile, std::path::PathBuf) {
    let campaign = CampaignFile::shipped_with(NINE_POINTS);
    let runs = campaign.runs();
    mapper(["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), runs.as_os_str()]).exits(0);
    let run = only_run(&runs);
    (campaign, run)
}

#[test]
#[cfg_attr(
    not(all(with_chromium, with_python)),
    ignore = "needs Chromium and Python: run `cargo xtask test`"
)]
fn the_page_of_a_run_is_read_as_people_do() {
    let (_campaign, run) = run_of_nine_points();
    let page = run.join("report.html");
    let text = std::fs::read_to_string(&page).unwrap();
    // A night of 60 points has to fit into 2 MB; this one is smaller, and most of it are the two libraries.
    assert!(text.len() < 1_000_000, "{} bytes", text.len());
    assert!(!text.contains("<img src=x"), "markup of a name got into the page");
    assert!(text.contains("&lt;img src=x onerror=alert(1)&gt;"), "the name is shown as text");

    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let pictures = scratch();
    let seen = python("browse_report.py", [chromium.as_ref(), page.as_os_str(), pictures.path().as_os_str()]);
    // Nothing was asked of anybody, nothing was complained of, nobody is shut out.
    assert_eq!(seen["requests"], serde_json::json!([]));
    assert_eq!(seen["said"], serde_json::json!([]));
    assert_eq!(seen["serious"], serde_json::json!([]));
    for size in ["1400_light", "1400_dark", "390_light", "390_dark"] {
        assert_eq!(seen[format!("overflow_{size}")], 0, "{size}: the page is wider than the screen");
    }
    // Every point that was identified is drawn, and no layer is lost: a channel with a wrong name drops one silently.
    let points: serde_json::Value =
        serde_json::from_slice(&std::fs::read(run.join("points.json")).unwrap()).unwrap();
    let points = points["points"].as_array().unwrap();
    let of_the_map = points.iter().filter(|point| point["kind"] != "repeat").count();
    assert_eq!(seen["points"], of_the_map);
    assert_eq!(seen["points_with_repeats"], points.len());
    assert_eq!(seen["eta_points"], of_the_map);
    assert_eq!(seen["jumps"], points.len() - 1);
    assert!(seen["paths"].as_u64() > seen["paths_without_contours"].as_u64(), "contours are drawn");
    assert_eq!([&seen["zoomed"], &seen["whole_again"]], [true, true], "the map is zoomed and whole again");
    assert_eq!(seen["chosen"], seen["clicked"], "a click on a point shows its transient");
    assert_eq!(seen["step_plots"], 6);
    assert_eq!(seen["by_keyboard"], true);
    // The words at the pointer are those of the point that was clicked.
    let clicked: usize = seen["clicked"].as_str().unwrap().parse().unwrap();
    let point = points.iter().find(|point| point["step"] == clicked).unwrap();
    let eta = format!("efficiency {:.2}", 100.0 * point["eta"].as_f64().unwrap());
    assert!(seen["tip"].as_str().unwrap().contains(&eta), "{}", seen["tip"]);
    assert!(seen["step_words"].as_str().unwrap().contains(&eta), "{}", seen["step_words"]);
    let column = |name: &str| -> Vec<f64> {
        seen[name].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
    };
    assert!(column("sorted_up").is_sorted() && column("sorted_down").iter().rev().is_sorted());
    // The print is a PDF.
    assert!(std::fs::read(pictures.path().join("report.pdf")).unwrap().starts_with(b"%PDF"));
}

#[test]
#[cfg_attr(
    not(all(with_chromium, with_python)),
    ignore = "needs Chromium and Python: run `cargo xtask test`"
)]
fn a_run_is_looked_at_and_stopped_through_its_live_page() {
    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let campaign = CampaignFile::shipped_with(NINE_POINTS);
    let (pictures, runs) = (scratch(), campaign.runs());
    // Two seconds a step, however slow this machine is: long enough to press a button within one.
    let run = mapper_command([
        "run".as_ref(),
        campaign.path.as_os_str(),
        "--out".as_ref(),
        runs.as_os_str(),
        "--pace".as_ref(),
        "60".as_ref(),
    ]);
    let command = std::iter::once(run.get_program()).chain(run.get_args());
    let seen =
        python("browse_live.py", [chromium.as_ref(), pictures.path().as_os_str()].into_iter().chain(command));
    for (what, status) in seen["refused"].as_object().unwrap() {
        assert!((403..=405).contains(&status.as_u64().unwrap()), "{what}: {status}");
    }
    // From the instant at which the program has identified a point to the row on the screen.
    let seconds = seen["seconds_to_be_seen"].as_array().unwrap();
    assert!(!seconds.is_empty() && seconds.iter().all(|s| s.as_f64().unwrap() < 1.0), "{seconds:?}");
    // A held step lasts; what was seen outlives a reload and a program that was silent.
    assert_eq!(seen["held_at"], seen["still_held_at"]);
    assert_eq!(seen["points_before_reload"], seen["points_after_reload"]);
    assert_eq!(seen["points_before_reload"], seen["points_after_loss"]);
    assert!(seen["said_alone"].as_str().unwrap().contains("the run goes on"), "{}", seen["said_alone"]);
    // The button has stopped the run at the end of a step, and is recorded with the other two.
    assert_eq!(seen["exit"], 130);
    let recorded = seen["recorded"].to_string();
    for asked in ["the step is held", "the step goes on", "the run stops at the end of the step"] {
        assert!(recorded.contains(&format!("operator, on the live page: {asked}")), "{recorded}");
    }
    assert!(seen["run"]["points"].as_u64().unwrap() >= 4, "{}", seen["run"]["points"]);
    assert!(
        seen["connection"].as_str().unwrap().contains("Stopped by the operator"),
        "{}",
        seen["connection"]
    );
    assert_eq!([&seen["said"], &seen["serious"], &seen["elsewhere"]], [&serde_json::json!([]); 3]);
    for size in ["1400_light", "1400_dark", "390_light", "390_dark"] {
        assert_eq!(seen[format!("overflow_{size}")], 0, "{size}: the page is wider than the screen");
    }
}

#[test]
fn another_run_is_drawn_beside_the_first_and_nothing_is_overwritten() {
    let (_campaign, run) = run_of_nine_points();
    let folder = scratch();
    let out = folder.path().join("both.html");
    let made =
        || mapper(["report".as_ref(), run.as_os_str(), run.as_os_str(), "-o".as_ref(), out.as_os_str()]);
    made().exits(0);
    let text = std::fs::read_to_string(&out).unwrap();
    assert!(text.contains("value=\"other0\""), "the other run has its switch");
    // The page that the run left has the same points.
    let points =
        |page: &str| page.split("\"points\":").nth(1).unwrap().split("\"map\":").next().unwrap().to_owned();
    assert_eq!(points(&text), points(&std::fs::read_to_string(run.join("report.html")).unwrap()));
    assert!(made().exits(1).stderr.contains("both.html"), "an existing file is not replaced");
}
