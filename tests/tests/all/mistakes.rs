//! A mistyped campaign: all mistakes are reported at once, and nothing is run.

use mapper_tests::{CampaignFile, mapper};

/// Mistakes, and the text that the caret has to mark.
const MISTAKES: &[(&str, &str, &str)] = &[
    ("T_oil: {noise: 0.2 K, offset", "T_oil: {noise: 0.2, offset", "0.2"),
    ("1.4, 2.0, 2.5]", "1.4, 2.0, 9.5]", "9.5"),
    ("  warm_up: 2 min", "  warm_up: 10 kPa", "10 kPa"),
    ("order: thermal_gradient ", "ordr: sum_gradient ", "ordr"),
    ("T1:    {noise: 0.1 K, ", "T1:    {nosie: 0.1 K, ", "nosie"),
];

fn mistyped() -> CampaignFile {
    let replacements: Vec<(&str, &str)> = MISTAKES.iter().map(|(right, wrong, _)| (*right, *wrong)).collect();
    CampaignFile::shipped_with(&replacements)
}

/// Every mistake is in `message` with its line number, the line, and a caret under what is wrong.
#[track_caller]
fn assert_all_mistakes_are_shown(campaign: &CampaignFile, message: &str) {
    let lines: Vec<&str> = message.lines().collect();
    for (_, wrong, at) in MISTAKES {
        let number = campaign.line_of(wrong);
        // The end of a long line may be cut, never what is wrong.
        let source = campaign.text.lines().nth(number - 1).unwrap();
        let source = &source[..source.find(wrong.trim()).unwrap() + wrong.trim().len()];
        let shown = lines
            .iter()
            .position(|line| line.trim_start().starts_with(&format!("{number} |")) && line.contains(source))
            .unwrap_or_else(|| panic!("line {number}, `{wrong}`, is not shown in\n{message}"));
        let carets = lines[shown + 1];
        let place = lines[shown].find(at).unwrap();
        assert_eq!(carets.find('^'), Some(place), "{}\n{carets}", lines[shown]);
    }
    assert!(message.contains(&format!("{} mistakes", MISTAKES.len())), "{message}");
}

#[test]
fn a_mistyped_campaign_is_not_run_and_all_its_mistakes_are_shown() {
    let campaign = mistyped();
    let out = campaign.runs();
    let finished = mapper([
        "run".as_ref(),
        campaign.path.as_os_str(),
        "--json".as_ref(),
        "--out".as_ref(),
        out.as_os_str(),
    ]);
    let finished = finished.exits(3);
    assert_all_mistakes_are_shown(&campaign, &finished.stderr);
    let report = finished.json();
    assert_eq!(
        (report["code"].as_u64(), report["findings"].as_array().map(Vec::len)),
        (Some(3), Some(MISTAKES.len()))
    );
    assert!(!out.exists(), "a run directory was made for a campaign with mistakes");
}

#[test]
fn check_and_plan_show_the_same_mistakes() {
    let campaign = mistyped();
    for command in ["check", "plan"] {
        let finished = mapper([command.as_ref(), campaign.path.as_os_str()]).exits(3);
        assert_all_mistakes_are_shown(&campaign, &finished.stderr);
        assert_eq!(finished.stdout, "", "{command}");
    }
}

#[test]
fn a_missing_file_is_reported_with_its_name() {
    for command in ["check", "plan", "run"] {
        let finished = mapper([command, "no/such/campaign.yaml"]).exits(1);
        assert!(finished.stderr.contains("no/such/campaign.yaml"), "{}", finished.stderr);
    }
    let finished = mapper(["identify", "no/such/recording.mcap"]).exits(1);
    assert!(finished.stderr.contains("no/such/recording.mcap"), "{}", finished.stderr);
}

#[test]
fn a_file_that_is_not_a_recording_is_refused() {
    let campaign = CampaignFile::shipped_with(&[]);
    let finished = mapper(["identify".as_ref(), campaign.path.as_os_str()]).exits(6);
    assert!(finished.stderr.contains("neither an MCAP recording nor a log"), "{}", finished.stderr);
}
