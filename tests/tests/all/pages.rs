//! Pages that the program writes, in a browser.

use mapper_tests::{CampaignFile, mapper, mapper_command, pictures, python, repository, scratch, shared_run};
use std::process::Command;

/// Four points of the gap rig.
pub(crate) const FOUR_POINTS: &[(&str, &str)] = &[
    (
        "speeds: [90 krpm, 150 krpm, 50 krpm, 130 krpm, 70 krpm, 110 krpm]",
        "speeds: [90 krpm, 150 krpm, 60 krpm, 120 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0]", "openings: [0.9]"),
];

/// Shorter ones, and a probe that conducts along its stem.
const SHORTER_AND_AN_EFFECT: &[(&str, &str)] = &[
    ("dwell: 120 s", "dwell: 60 s"),
    ("end: 110 s}", "end: 55 s}"),
    ("    weather: wandering\n", "    weather: wandering\n    effects: {stem_conduction: 8 %}\n"),
];

#[test]
#[cfg_attr(not(with_chromium), ignore = "needs Chromium: run `cargo xtask test`")]
fn a_diagnosis_opens_in_a_browser_with_all_its_pictures() {
    let shipped = std::fs::read_to_string(repository().join("campaigns/gap_rig.yaml")).unwrap();
    let text = FOUR_POINTS.iter().chain(SHORTER_AND_AN_EFFECT).fold(shipped, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let campaign = CampaignFile::of(text);
    let run = shared_run(&campaign).run;
    let scratch = scratch();
    let page = scratch.path().join("gap.html");
    let diagnosed = mapper([
        "gap".as_ref(),
        "diagnose".as_ref(),
        campaign.path.as_os_str(),
        "--recording".as_ref(),
        run.as_os_str(),
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
    let (dom, log) = (String::from_utf8_lossy(&browsed.stdout), String::from_utf8_lossy(&browsed.stderr));
    assert!(browsed.status.success(), "{log}");
    assert!(!log.contains("CONSOLE"), "the page complains: {log}");
    // Two maps of where, and four traces; the parser of a browser leaves out what is not an SVG.
    assert_eq!(dom.matches("<svg").count(), 6, "{dom}");
    assert!(dom.matches("<polyline").count() + dom.matches("<path").count() > 8);

    // The same on the page of the run.
    let whole = scratch.path().join("run.html");
    let arguments = ["report".as_ref(), run.as_os_str(), "--gap".as_ref(), campaign.path.as_os_str()];
    mapper(arguments.into_iter().chain(["-o".as_ref(), whole.as_os_str()])).exits(0);
    if option_env!("MAPPER_TEST_PYTHON").is_some() {
        let pictures = pictures("gap");
        // What a click does is the business of `the_page_of_a_run_works_in_a_browser`.
        let looked_at = [chromium.as_ref(), whole.as_os_str(), pictures.as_os_str(), "looked_at".as_ref()];
        let seen = python("browse_report.py", looked_at);
        for quiet in ["requests", "console", "serious"] {
            assert_eq!(seen[quiet], serde_json::json!([]), "{quiet}");
        }
        assert_eq!(seen["heads_without_sorting"], 0, "the tables of the gap are sorted too");
    }
    let text = std::fs::read_to_string(whole).unwrap();
    let section = text.split("id=\"gap\"").nth(1).unwrap();
    assert!(section.contains("(stem_conduction) explains the gap") && section.matches("<svg").count() == 6);
    for heading in ["Causes", "Location", "Evidence", "What to do"] {
        assert!(dom.contains(&format!("<h2>{heading}")), "{heading}");
    }
    assert!(dom.contains("<ol><li>"), "a cause that is named leads to actions");
    // The page loads no other file.
    assert!(!dom.contains("src=\"http") && !dom.contains("href=\"http"));
}

/// Nine points of turbo_a with repeats, without a soak; the operator's name is markup.
pub(crate) const NINE_POINTS: &[(&str, &str)] = &[
    (
        "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
        "speeds: [80 krpm, 110 krpm, 140 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.0, 1.4]"),
    ("warm_up: 2 min ", "warm_up: 60 s "),
    ("dwell: 40 s ", "dwell: 120 s "),
    ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ("operator: virtual\n", "operator: '</script><img src=x onerror=alert(1)>'\n"),
];

/// The directory of a run of them.
pub(crate) fn run_of_nine_points() -> std::path::PathBuf {
    shared_run(&CampaignFile::shipped_with(NINE_POINTS)).run
}

#[test]
#[cfg_attr(
    not(all(with_chromium, with_python)),
    ignore = "needs Chromium and Python: run `cargo xtask test`"
)]
fn the_page_of_a_run_works_in_a_browser() {
    let run = run_of_nine_points();
    let page = run.join("report.html");
    let text = std::fs::read_to_string(&page).unwrap();
    // A night of 60 points has to fit into 2 MB; this one is smaller, and most of it are the two libraries.
    assert!(text.len() < 1_000_000, "{} bytes", text.len());
    assert!(!text.contains("<img src=x"), "markup of a name got into the page");
    assert!(text.contains("&lt;img src=x onerror=alert(1)&gt;"), "the name is shown as text");
    // What a test report has to name, here and in the plain one.
    let plain = std::fs::read_to_string(run.join("report.md")).unwrap();
    for (what, words) in [
        ("serial number", "TA-0001"),
        ("program with its commit", "mapper 0."),
        ("that nothing was measured", "simulated"),
        ("reference state", "298 K, 100 kPa"),
        ("conditions as read", "turbine inlet temperature T3, total"),
        ("calibration", "2026-09-02"),
        ("uncertainty of every reading", "as used +/-"),
        ("corrected speed of a line", "krpm corrected"),
    ] {
        assert!(text.contains(words), "{what} is not on the page");
        assert!(plain.contains(words), "{what} is not in report.md");
    }
    let picture = std::fs::read_to_string(run.join("map.svg")).unwrap();
    assert!(picture.contains("corrected mass flow, g/s"), "the picture is in the campaign's units");

    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let pictures = pictures("report");
    let seen = python("browse_report.py", [chromium.as_ref(), page.as_os_str(), pictures.as_os_str()]);
    // The page makes no request, the console is empty, and the page is accessible.
    assert_eq!(seen["requests"], serde_json::json!([]));
    assert_eq!(seen["console"], serde_json::json!([]));
    assert_eq!(seen["serious"], serde_json::json!([]));
    for size in ["1400_light", "390_dark"] {
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
    assert_eq!(seen["step_plots"], 7, "T2 and Tc with their residuals, speed, flow and pressures");
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
    let all_right = |pair: &serde_json::Value| *pair == serde_json::json!([true, true]);
    assert!(seen["copied"].as_array().unwrap().iter().all(all_right), "{}", seen["copied"]);
    assert!(seen["tables"].as_u64().unwrap() >= 6);
    assert_eq!(seen["heads_without_sorting"], 0, "every table is sorted by its heads");
    assert!(column("sorted_up").is_sorted() && column("sorted_down").iter().rev().is_sorted());
    // The print is a PDF; heads of tables stand on each of its sheets, and at its foot whose map it is.
    assert_eq!(seen["heads_repeated"], true);
    assert!(
        text.contains("@bottom-left{content:") && text.contains("TA\\2d 0001"),
        "the foot names the machine"
    );
    assert!(std::fs::read(pictures.join("report.pdf")).unwrap().starts_with(b"%PDF"));
}

#[test]
#[cfg_attr(
    not(all(with_chromium, with_python)),
    ignore = "needs Chromium and Python: run `cargo xtask test`"
)]
fn the_live_page_shows_and_stops_a_run() {
    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let campaign = CampaignFile::shipped_with(NINE_POINTS);
    let (pictures, runs) = (pictures("live"), campaign.runs());
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
    let seen = python("browse_live.py", [chromium.as_ref(), pictures.as_os_str()].into_iter().chain(command));
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
    assert!(seen["shown_alone"].as_str().unwrap().contains("the run goes on"), "{}", seen["shown_alone"]);
    // The button has stopped the run at the end of a step, and is recorded with the other two.
    assert_eq!(seen["exit"], 130);
    let recorded = seen["recorded"].to_string();
    for asked in ["the step is held", "the step continues", "the run stops at the end of the step"] {
        assert!(recorded.contains(&format!("operator, on the live page: {asked}")), "{recorded}");
    }
    assert!(seen["contours"].as_u64().unwrap() > 0, "the map has contours while it fills up");
    assert!(seen["run"]["points"].as_u64().unwrap() >= 4, "{}", seen["run"]["points"]);
    assert!(
        seen["connection"].as_str().unwrap().contains("Stopped by the operator"),
        "{}",
        seen["connection"]
    );
    assert_eq!([&seen["console"], &seen["serious"], &seen["elsewhere"]], [&serde_json::json!([]); 3]);
    for size in ["1400_light", "390_dark"] {
        assert_eq!(seen[format!("overflow_{size}")], 0, "{size}: the page is wider than the screen");
    }
}

#[test]
fn without_a_browser_the_page_is_kept_and_a_remedy_is_printed() {
    let (run, folder) = (run_of_nine_points(), scratch());
    let out = folder.path().join("page.html");
    let mut report = mapper_command(["report", "--pdf", "-o"]);
    let ended = report.arg(&out).arg(&run).env("PATH", "").output().unwrap();
    assert_eq!(ended.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ended.stderr).contains("install `chromium`"));
    assert!(out.exists() && !out.with_extension("pdf").exists());
}

#[test]
#[cfg_attr(not(with_chromium), ignore = "needs Chromium: run `cargo xtask test`")]
fn a_page_is_printed_by_the_browser_on_the_path() {
    let (run, folder) = (run_of_nine_points(), scratch());
    let out = folder.path().join("page.html");
    let made = [
        "report".as_ref(),
        run.as_os_str(),
        "--pdf".as_ref(),
        "--json".as_ref(),
        "-o".as_ref(),
        out.as_os_str(),
    ];
    let files = mapper(made).exits(0).json();
    let pdf = std::fs::read(files["pdf"].as_str().unwrap()).unwrap();
    assert!(pdf.starts_with(b"%PDF") && pdf.len() > 50_000, "{} bytes", pdf.len());
}

#[test]
fn a_page_compares_two_runs_and_overwrites_nothing() {
    let run = run_of_nine_points();
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

#[test]
#[cfg_attr(
    not(all(with_chromium, with_python)),
    ignore = "needs Chromium and Python: run `cargo xtask test`"
)]
fn the_live_page_is_served_over_tls_to_another_address() {
    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let campaign = CampaignFile::shipped_with(NINE_POINTS);
    let (folder, runs) = (scratch(), campaign.runs());
    let run = mapper_command([
        "run".as_ref(),
        campaign.path.as_os_str(),
        "--out".as_ref(),
        runs.as_os_str(),
        "--pace".as_ref(),
        "60".as_ref(),
    ]);
    let command = std::iter::once(run.get_program()).chain(run.get_args());
    let seen = python(
        "browse_live_tls.py",
        [chromium.as_ref(), folder.path().as_os_str()].into_iter().chain(command),
    );
    for (what, answer) in seen["refused"].as_object().unwrap() {
        let (code, message) = (answer[0].as_i64().unwrap(), answer[1].as_str().unwrap());
        assert!(
            code != 0 && (message.contains(".pem") || message.contains(".key") || message.contains("--live")),
            "{what}: {message}"
        );
    }
    // Without TLS there is a warning, with TLS there is none.
    let clear = seen["printed_in_clear"].as_str().unwrap();
    assert_eq!(clear.matches("WITHOUT encryption").count(), 1, "{clear}");
    assert!(
        !seen["printed_encrypted"].as_str().unwrap().contains("WITHOUT"),
        "{}",
        seen["printed_encrypted"]
    );
    assert_eq!(seen["scheme"], "https");
    assert_eq!(seen["page"], serde_json::json!([200, true, true]));
    assert_eq!(seen["without_token"], 401);
    assert_eq!(seen["with_token"], serde_json::json!([200, "data: {\"campaign"]));
    assert_eq!(seen["page_in_clear_presses"], 403, "a page in clear is not the server's own");
    // Who says nothing gets an alert (0x15) when its time is over.
    assert_eq!(
        [&seen["in_clear"], &seen["silent"], &seen["unknown"]],
        [&serde_json::json!(false), &serde_json::json!("\u{15}"), &serde_json::json!("refused")]
    );
    assert!(seen["connection"].as_str().unwrap().contains("Stopped by the operator"));
    assert_eq!(seen["exit"], 130);
}

/// The scripts in the pages are those that their makers publish, byte for byte.
#[test]
#[cfg_attr(not(with_npm), ignore = "needs npm and its registry: run `cargo xtask test`")]
fn the_scripts_are_those_of_the_npm_packages() {
    let scratch = scratch();
    for (package, packed, script) in [
        ("d3@7.9.2", "d3-7.9.2.tgz", "d3.min.js"),
        ("@observablehq/plot@0.6.17", "observablehq-plot-0.6.17.tgz", "plot.umd.min.js"),
    ] {
        let run = |program: &str, arguments: &[&str]| {
            let done = Command::new(program).args(arguments).current_dir(scratch.path()).output().unwrap();
            assert!(done.status.success(), "{package}: {}", String::from_utf8_lossy(&done.stderr));
            done.stdout
        };
        run("npm", &["pack", "--silent", package]);
        let published =
            run("tar", &["--extract", "--to-stdout", "--file", packed, &format!("package/dist/{script}")]);
        let ours = std::fs::read(repository().join("crates/report/assets").join(script)).unwrap();
        assert!(published == ours, "{script} is not that of {package}");
    }
}
