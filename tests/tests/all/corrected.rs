//! Diagnoses that are kept in a file, and maps that are corrected with them.

use crate::pages::FOUR_POINTS;
use mapper_tests::{CampaignFile, mapper, mapper_command, repository, scratch, shared_run};
use serde_json::Value;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Four points of the gap rig with a preheated inlet, which biases every efficiency.
fn preheated() -> CampaignFile {
    let shipped = std::fs::read_to_string(repository().join("campaigns/gap_rig.yaml")).unwrap();
    let weather = "    weather: wandering\n";
    let text = FOUR_POINTS.iter().fold(shipped, |text, (from, to)| text.replace(from, to));
    CampaignFile::of(text.replace(weather, &format!("{weather}    effects: {{inlet_preheat: 3 W/K}}\n")))
}

fn correct(campaign: &Path, recording: &Path, more: &[&OsStr]) -> mapper_tests::Finished {
    let arguments = ["gap".as_ref(), "correct".as_ref(), campaign.as_os_str(), recording.as_os_str()];
    mapper(arguments.into_iter().chain(["--json".as_ref()]).chain(more.iter().copied()))
}

/// A copy of the recording of a run of this campaign.
fn copied(campaign: &CampaignFile, into: &Path, name: &str) -> PathBuf {
    let own = into.join(name);
    std::fs::copy(shared_run(campaign).run.join("recording.mcap"), &own).unwrap();
    own
}

#[test]
fn a_kept_diagnosis_corrects_as_a_new_one_and_only_its_own_recording() {
    let (campaign, scratch) = (preheated(), scratch());
    let recording = copied(&campaign, scratch.path(), "night.mcap");
    let new = correct(&campaign.path, &recording, &[]).exits(0).json();
    assert_eq!(new["diagnosis_file"], Value::Null);
    let kept = scratch.path().join("kept.json");
    let diagnose = |out: &Path| {
        let words = ["gap", "diagnose"].map(OsStr::new);
        let files = [campaign.path.as_os_str(), recording.as_os_str(), "--out".as_ref(), out.as_os_str()];
        mapper(words.into_iter().chain(files))
    };
    diagnose(&kept).exits(0);
    assert!(diagnose(&kept).exits(1).stderr.contains("kept.json"), "an existing file is not replaced");
    let from_file = correct(&campaign.path, &recording, &["--diagnosis".as_ref(), kept.as_os_str()]);
    let from_file = from_file.exits(0).json();
    assert_eq!(from_file["diagnosis_file"], kept.to_str().unwrap());
    let points = |of: &Value| of["correction"]["points"].as_array().unwrap().clone();
    assert_eq!(points(&new).len(), 4);
    for (new, kept) in points(&new).iter().zip(&points(&from_file)) {
        for when in ["before", "after"] {
            let pairs = new[when].as_array().unwrap().iter().zip(kept[when].as_array().unwrap());
            for (new, kept) in pairs {
                assert!((new.as_f64().unwrap() - kept.as_f64().unwrap()).abs() < 1e-9, "{new} and {kept}");
            }
        }
    }

    let text = std::fs::read_to_string(&kept).unwrap();
    let refused = |name: &str, text: &str, campaign: &Path, recording: &Path| {
        let file = scratch.path().join(name);
        std::fs::write(&file, text).unwrap();
        let message =
            correct(campaign, recording, &["--diagnosis".as_ref(), file.as_os_str()]).exits(3).stderr;
        assert!(message.contains(name) && message.contains("diagnos"), "{message}");
    };
    let probability = text.find("\"probability\": 0.").unwrap() + "\"probability\": 0.".len();
    let mut tampered = text.clone();
    tampered.replace_range(
        probability..probability + 1,
        if text[probability..].starts_with('9') { "8" } else { "9" },
    );
    refused("tampered.json", &tampered, &campaign.path, &recording);
    refused("other.json", "{\"format_version\": 3}", &campaign.path, &recording);
    refused(
        "later.json",
        &text.replace("\"format_version\": 3", "\"format_version\": 99"),
        &campaign.path,
        &recording,
    );
    // The same machine and plan on another night.
    let changed =
        CampaignFile::of(std::fs::read_to_string(&campaign.path).unwrap().replacen("seed: ", "seed: 1", 1));
    let other_night = copied(&changed, scratch.path(), "other.mcap");
    refused("foreign.json", &text, &campaign.path, &other_night);
    refused("other_campaign.json", &text, &changed.path, &recording);

    // Next to the recording it is found; one that does not belong there is not used, and the answer is that of a new diagnosis.
    std::fs::copy(&kept, recording.with_extension("diagnosis.json")).unwrap();
    let found = correct(&campaign.path, &recording, &[]).exits(0).json();
    assert_eq!(found["diagnosis_file"], recording.with_extension("diagnosis.json").to_str().unwrap());
    std::fs::write(recording.with_extension("diagnosis.json"), tampered).unwrap();
    let ignored = correct(&campaign.path, &recording, &[]).exits(0);
    assert!(ignored.stderr.contains("night.diagnosis.json"), "{}", ignored.stderr);
    assert_eq!(ignored.json()["correction"], new["correction"]);
}

/// Ctrl-C during the search: the exit code of a stop, and no file.
#[cfg(unix)]
#[test]
fn a_stopped_diagnosis_leaves_nothing() {
    let (campaign, scratch) = (preheated(), scratch());
    let recording = copied(&campaign, scratch.path(), "night.mcap");
    let arguments = ["gap".as_ref(), "diagnose".as_ref(), campaign.path.as_os_str(), recording.as_os_str()];
    let mut running = mapper_command(arguments)
        .args(["--progress", "json", "--out"])
        .arg(scratch.path().join("kept.json"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut messages = BufReader::new(running.stderr.take().unwrap()).lines().map(Result::unwrap);
    let is_search = |line: &String| {
        serde_json::from_str(line).is_ok_and(|message: Value| message["what"] == "single effects")
    };
    messages.find(is_search).unwrap();
    let id = running.id().to_string();
    Command::new("sh").args(["-c", "kill -INT \"$1\"", "sh", &id]).status().unwrap();
    messages.for_each(drop);
    assert_eq!(running.wait().unwrap().code(), Some(130));
    let left = std::fs::read_dir(scratch.path()).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(left.collect::<Vec<_>>(), ["night.mcap"]);
}
