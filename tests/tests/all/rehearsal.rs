//! The lab server: the virtual lab behind Modbus, OPC UA and AK, seen by programs of others and by the drivers. And what is written where a driver
//! has a secret.
#![cfg(unix)]

use crate::drivers::{Server, done, of_the_guide, short, with_drivers};
use mapper_tests::{CampaignFile, build_driver, mapper_command, python, repository, scratch};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const USER: &str = "margarethe";
const PASSWORD: &str = "hunter2-of-the-stand";

fn program(name: &str) -> PathBuf {
    Path::new(mapper_command([""; 0]).get_program()).with_file_name(name)
}

/// A lab server that ends with the test; where it is.
struct Lab {
    process: Child,
    places: Vec<String>,
    /// What it says of each of them.
    notes: Vec<String>,
}

impl Lab {
    fn start(servers: &[&str], user: Option<(&str, &str)>, state: &Path) -> Lab {
        build_driver("mapper-lab-server");
        let mut command = Command::new(program("mapper-lab-server"));
        command.arg("campaigns/turbo_a.yaml").current_dir(repository()).env("MAPPER_STATE_DIR", state);
        for server in servers {
            command.args([&format!("--{server}"), "127.0.0.1:0"]);
        }
        if let Some((name, password)) = user {
            command.env("PLC_USER", name).env("PLC_PASSWORD", password);
        }
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines();
        let place = |server: &&str| {
            let line = lines.next().unwrap().unwrap();
            line.strip_prefix(&format!("{server} ")).unwrap().to_owned()
        };
        let places = servers.iter().map(place).collect();
        let notes = servers.iter().map(|_| lines.next().unwrap().unwrap()).collect();
        // Later output is read and dropped, so that a full pipe cannot end it.
        std::thread::spawn(move || lines.count());
        Lab { process, places, notes }
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn checked(name: &str, campaign: &CampaignFile, state: &Path, password: &str) -> mapper_tests::Finished {
    let arguments = ["backend", "check", name, "--campaign"].map(std::ffi::OsStr::new);
    let arguments: Vec<_> = arguments.into_iter().chain([campaign.path.as_os_str()]).collect();
    let mut command = with_drivers(&arguments);
    command.env("MAPPER_STATE_DIR", state).env("PLC_USER", USER).env("PLC_PASSWORD", password);
    done(command)
}

/// All thirteen rules are kept, with a separate state directory.
fn keeps_every_rule(name: &str, campaign: &CampaignFile, state: &Path) {
    let finished = checked(name, campaign, state, PASSWORD);
    assert!(!finished.stdout.contains("BROKEN"), "{}", finished.stdout);
    assert_eq!(finished.exits(0).stdout.lines().count(), 13);
}

fn trust(endpoint: &str, state: &Path) {
    build_driver("mapper-backend-opcua");
    let mut command = Command::new(program("mapper-backend-opcua"));
    command.args(["trust", endpoint]).env("MAPPER_STATE_DIR", state);
    done(command).exits(0);
}

/// asyncua, which shares no code with it, reads, writes, is refused, and sees the interlocks.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn an_independent_client_controls_the_lab_over_opcua() {
    let scratch = scratch();
    let lab = Lab::start(&["opcua"], Some(("lab", "hunter2")), scratch.path());
    let seen = python("opcua_client.py", [lab.places[0].as_ref(), scratch.path().as_os_str()]);
    let offered = ["Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss", "Basic256Sha256"];
    assert_eq!(seen["offered"], serde_json::json!(offered.map(|one| format!("{one} SignAndEncrypt"))));
    assert!(
        ["BadIdentityTokenRejected", "BadUserAccessDenied"]
            .contains(&seen["wrong_password"].as_str().unwrap()),
        "{seen}"
    );
    assert_eq!(seen["names"].as_array().unwrap().len(), 15 + 4 + 4, "{seen}");
    assert_eq!(seen["too_much"], "BadOutOfRange");
    assert!(
        ["BadNotWritable", "BadUserAccessDenied"].contains(&seen["read_only"].as_str().unwrap()),
        "{seen}"
    );
    assert_eq!(seen["wrong_type"], "BadTypeMismatch");
    assert!(seen["written"].as_array().unwrap().iter().all(|code| code == "Good"), "{seen}");
    assert!(seen["rpm"].as_f64().unwrap() > 20e3 && seen["tripped_while_beating"] == false, "{seen}");
    // The time is the stand's own: within its step and what a machine that is busy adds; an unset time would be of another day.
    assert!(
        seen["youngest_s"].as_f64().unwrap() > -0.01 && seen["oldest_s"].as_f64().unwrap() < 10.0,
        "{seen}"
    );
    assert!(seen["tripped"] == true && seen["air_after"] == false, "{seen}");
    assert!(seen["air_before_acknowledge"] == false && seen["tripped_after_acknowledge"] == false, "{seen}");
}

/// A rig that cannot be armed is not judged: a server that is off, a wrong password (more often than the server has sessions), an order of words
/// that is wrong, a unit that is not there. One sentence gives the reason, and no rule is reported as kept.
#[test]
fn a_rig_that_cannot_be_armed_is_not_checked() {
    let scratch = scratch();
    let lab = Lab::start(&["modbus", "opcua"], Some((USER, PASSWORD)), scratch.path());
    let [modbus, opcua] = &lab.places[..] else { panic!("{:?}", lab.places) };
    let not_judged = |name: &str, campaign: &CampaignFile, password: &str, reasons: &[&str]| {
        let finished = checked(name, campaign, scratch.path(), password).exits(5);
        assert_eq!(finished.stdout, "");
        assert_eq!(finished.stderr.trim_end().lines().count(), 1, "{}", finished.stderr);
        let begun = format!("mapper: `{name}` cannot be armed, so none of the 13 rules was checked: ");
        assert!(finished.stderr.starts_with(&begun), "{}", finished.stderr);
        for reason in reasons {
            assert!(finished.stderr.contains(reason), "{reason}: {}", finished.stderr);
        }
    };
    // The message states the expected variables, not the secrets.
    assert!(lab.notes[0].contains("`unit: 255` or 0;"), "{:?}", lab.notes);
    assert!(
        lab.notes[1].contains("for the user in $PLC_USER with the password in $PLC_PASSWORD"),
        "{:?}",
        lab.notes
    );
    let at = format!("{modbus} ");
    let of_modbus = |old: &str, new: &str| {
        of_the_guide(
            "modbus",
            &[("127.0.0.1:5020 ", &*at), ("timeout: 200 ms", "timeout: 800 ms"), (old, new)],
        )
    };
    let wrong_words = of_modbus("words: big ", "words: little ");
    not_judged(
        "modbus",
        &wrong_words,
        PASSWORD,
        &["at `read.", " reads ", " from register ", "`words: big` and `bytes: big`"],
    );
    let no_unit = of_modbus("unit: 255", "unit: 7");
    not_judged("modbus", &no_unit, PASSWORD, &["no unit 7", "`unit`"]);
    let off = of_the_guide("modbus", &[("127.0.0.1:5020 ", "127.0.0.1:9 ")]);
    not_judged("modbus", &off, PASSWORD, &["127.0.0.1:9: Connection refused"]);
    trust(opcua, scratch.path());
    let campaign =
        of_the_guide("opcua", &[("opc.tcp://127.0.0.1:4840", opcua), ("timeout: 300 ms", "timeout: 800 ms")]);
    // The server has 20 sessions: the last ones would hear of those.
    for _ in 0..22 {
        not_judged("opcua", &campaign, "wrong", &["refuses the login", "user and password"]);
    }

    // A campaign of another backend.
    let finished = checked("modbus", &campaign, scratch.path(), PASSWORD).exits(3);
    assert!(finished.stderr.contains("this campaign names `opcua`, not `modbus`"), "{}", finished.stderr);
}

/// One stand with three servers at once, with the settings of the guide.
#[test]
#[cfg_attr(not(with_python), ignore = "takes minutes: run `cargo xtask test`")]
fn the_lab_behind_its_servers_keeps_every_rule() {
    let scratch = scratch();
    let lab = Lab::start(&["modbus", "opcua", "ak"], Some((USER, PASSWORD)), scratch.path());
    let [modbus, opcua, ak] = &lab.places[..] else { panic!("{:?}", lab.places) };
    let slower = "timeout: 800 ms";
    let campaign =
        of_the_guide("modbus", &[("127.0.0.1:5020 ", &format!("{modbus} ")), ("timeout: 200 ms", slower)]);
    keeps_every_rule("modbus", &campaign, scratch.path());
    trust(opcua, scratch.path());
    let campaign = of_the_guide("opcua", &[("opc.tcp://127.0.0.1:4840", opcua), ("timeout: 300 ms", slower)]);
    keeps_every_rule("opcua", &campaign, scratch.path());
    build_driver("mapper-backend-ak");
    let campaign = of_the_guide(
        "ak",
        &[("192.168.0.7:8888", ak), ("scale: 0.001", "scale: 1"), ("value: 1,", "value: 2,")],
    );
    keeps_every_rule("ak", &campaign, scratch.path());
}

fn asked(stream: &mut TcpStream, question: &[u8]) -> String {
    stream.write_all(question).unwrap();
    let mut answer = Vec::new();
    while answer.last() != Some(&3) {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        answer.push(byte[0]);
    }
    String::from_utf8(answer).unwrap()
}

/// No program of others speaks AK: questions as manuals print them, byte by byte, and what no instrument would send.
#[test]
fn the_lab_answers_ak_telegrams_like_the_manuals() {
    let scratch = scratch();
    let lab = Lab::start(&["ak"], None, scratch.path());
    let mut stream = TcpStream::connect(&lab.places[0]).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    assert_eq!(asked(&mut stream, b"\x02 ASTZ K0\x03"), "\x02 ASTZ 0 SREM READY\x03");
    assert_eq!(asked(&mut stream, b"\x02 AXXX K0\x03"), "\x02 ???? 0\x03");
    // A command is not known: nothing here is controlled.
    assert_eq!(asked(&mut stream, b"\x02 SREM K0\x03"), "\x02 ???? 0\x03");
    let all = asked(&mut stream, b"noise\x03\x02 AKON K0\x02 AKON K0\x03");
    let words: Vec<&str> = all.trim_end_matches('\x03').split(' ').collect();
    assert_eq!((words[1], words[2], words.len()), ("AKON", "0", 3 + 15), "{all}");
    let p1_pa: f64 = words[3 + 2].parse().unwrap();
    assert!((90e3..110e3).contains(&p1_pa), "{all}");
    assert_eq!(asked(&mut stream, b"\x02 AKON K16\x03"), "\x02 ???? 0\x03");
    assert!(asked(&mut stream, b"\x02 AKON K3\x03").starts_with("\x02 AKON 0 "));
}

#[test]
fn a_lab_server_reports_missing_options_and_refuses_public_addresses() {
    build_driver("mapper-lab-server");
    let run = |arguments: &[&str], password: Option<&str>| {
        let mut command = Command::new(program("mapper-lab-server"));
        command.arg("campaigns/turbo_a.yaml").args(arguments).current_dir(repository());
        if let Some(password) = password {
            command.env("PLC_PASSWORD", password);
        }
        let output = command.output().unwrap();
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(run(&[], None).contains("--modbus"));
    assert!(run(&["--ak", "0.0.0.0:0"], None).contains("--public"));
    assert!(run(&["--clear", "--modbus", "127.0.0.1:0"], None).contains("--opcua"));
    let half = run(&["--opcua", "127.0.0.1:0"], Some(PASSWORD));
    assert!(half.contains("PLC_USER") && !half.contains(PASSWORD), "{half}");
}

/// What a browser receives that looks on, and the token that it has to show.
fn live_page(url: &str) -> (Vec<u8>, String) {
    let (address, token) = url.trim_start_matches("http://").split_once("/#token=").unwrap();
    let mut all = Vec::new();
    for path in ["/", "/events"] {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(3))).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\n\r\n")
            .unwrap();
        // Events come without end: what came until nothing came for three seconds, or enough.
        let mut bytes = [0; 65536];
        while let Ok(count) = stream.read(&mut bytes) {
            all.extend_from_slice(&bytes[..count]);
            if count == 0 || all.len() > 4_000_000 {
                break;
            }
        }
    }
    (all, token.to_owned())
}

fn files(directory: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { all.extend(files(&path)) } else { all.push(path) }
    }
    all
}

fn holds(bytes: &[u8], word: &str) -> bool {
    bytes.windows(word.len()).any(|window| window == word.as_bytes())
}

/// A run against asyncua with user and password, looked at by its live page with its token, ended by a guard; then one with a wrong password. Neither
/// name nor password is in anything that was written or printed, and the token only in the line that announces it.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn secrets_appear_in_no_file_or_output() {
    build_driver("mapper-backend-opcua");
    let scratch = scratch();
    let (pki, state) = (scratch.path().join("pki"), scratch.path().join("state"));
    let secure = ["0", "--secure", pki.to_str().unwrap(), "--user", USER, "--password", PASSWORD];
    let (server, port) = Server::start("opcua_rig.py", &secure);
    trust(&format!("opc.tcp://127.0.0.1:{port}"), &state);
    let guide =
        of_the_guide("opcua", &[(":4840", &format!(":{port}")), ("timeout: 300 ms", "timeout: 800 ms")]);
    let campaign = CampaignFile::of(format!("{}\nguards: {{overspeed: {{above: 40 krpm}}}}\n", guide.text));
    let runs = campaign.runs();
    let arguments = [
        "run".as_ref(),
        campaign.path.as_os_str(),
        "--live=0.0.0.0:0".as_ref(),
        "--out".as_ref(),
        runs.as_os_str(),
    ];
    let sent = scratch.path().join("sent.txt");
    // Another state: the guard has latched the rig of the first.
    let other_state = scratch.path().join("other-state");
    trust(&format!("opc.tcp://127.0.0.1:{port}"), &other_state);
    let start = |password: &str, state: &Path, more: &[&str]| {
        let mut command = with_drivers(&arguments);
        command.args(more).env("MAPPER_STATE_DIR", state).env("PLC_USER", USER).env("PLC_PASSWORD", password);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let mut running = start(PASSWORD, &state, &[]);
    let mut stderr = BufReader::new(running.stderr.take().unwrap()).lines();
    let mut words = String::new();
    let url = loop {
        let line = stderr.next().expect("the live page is named").unwrap();
        words += &line;
        if let Some(url) = line.strip_prefix("live page: ") {
            words = words.replace(url, "");
            break url.trim().to_owned();
        }
    };
    let (page, token) = live_page(&url);
    assert!(holds(&page, "event-stream") && page.len() > 10_000, "{}", page.len());
    words.extend(stderr.map(|line| line.unwrap() + "\n"));
    let output = running.wait_with_output().unwrap();
    words += &String::from_utf8(output.stdout).unwrap();
    assert!(words.contains("above its limit of 40.00 krpm"), "the guard has ended it: {words}");
    let refused = start("wrong-one", &other_state, &["--json"]).wait_with_output().unwrap();
    assert!(!refused.status.success());
    let refused = [refused.stdout, refused.stderr].concat();
    assert!(holds(&refused, "refuses the login"), "{}", String::from_utf8_lossy(&refused));
    server.end();

    std::fs::write(&sent, [page, words.into_bytes(), refused].concat()).unwrap();
    // Recordings are packed: what is in them is read as another program reads it.
    let recordings: Vec<PathBuf> =
        files(&runs).into_iter().filter(|path| path.extension().is_some_and(|end| end == "mcap")).collect();
    assert!(!recordings.is_empty());
    for recording in &recordings {
        let read = python("unpack_recording.py", [recording]);
        std::fs::write(&sent, [std::fs::read(&sent).unwrap(), read.to_string().into_bytes()].concat())
            .unwrap();
    }
    // The names of the variables are not secret: what was looked at has the campaign in it.
    assert!(holds(&std::fs::read(&sent).unwrap(), "PLC_PASSWORD"));
    let mut looked_at = files(&runs);
    looked_at.extend(files(&state));
    looked_at.extend(files(&other_state));
    looked_at.push(sent);
    assert!(looked_at.iter().any(|path| path.ends_with("plan.json")), "{looked_at:?}");
    for path in looked_at {
        let bytes = std::fs::read(&path).unwrap();
        for secret in [USER, PASSWORD, "wrong-one", &token] {
            assert!(!holds(&bytes, secret), "{} holds {secret}", path.display());
        }
    }
}

/// A rig that says something else of itself than when the plan was made is another rig.
#[test]
fn a_plan_for_a_changed_rig_is_refused() {
    mapper_tests::build_drivers();
    let built_in = short("  virtual_lab: {}");
    let other = short("  virtual_lab: {sample_rate: 20 Hz}");
    let behind = |lab: &CampaignFile| short(&format!("  lab: {{campaign: {}}}", lab.path.display()));
    let campaign = behind(&built_in);
    let runs = campaign.runs();
    let run = |more: &[&str]| {
        let arguments = ["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), runs.as_os_str()];
        let mut command = with_drivers(&arguments);
        command.args(more);
        done(command)
    };
    run(&[]).exits(0);
    let plan = files(&runs).into_iter().find(|path| path.ends_with("plan.json")).unwrap();
    let kept = std::fs::read_to_string(&plan).unwrap();
    assert!(kept.contains("\"rig_sha256\""));
    run(&["--plan", plan.to_str().unwrap()]).exits(0);
    // The campaign is the same to the letter; the rig behind the driver is not.
    std::fs::copy(&other.path, &built_in.path).unwrap();
    let refused = run(&["--plan", plan.to_str().unwrap()]);
    assert!(refused.stderr.contains("description of the rig"), "{}", refused.stderr);
    assert_ne!(refused.code, Some(0));

    // Broken off behind its second step, the run does not go on there either; on its own rig it does.
    let broken = plan.parent().unwrap();
    std::fs::remove_file(broken.join("points.json")).unwrap();
    let journal = broken.join("journal.jsonl");
    let lines = std::fs::read_to_string(&journal).unwrap();
    let saved = lines.lines().position(|line| line.contains("\"step_saved\":2")).unwrap();
    let until_then: String = lines.split_inclusive('\n').take(saved + 1).collect();
    std::fs::write(&journal, until_then).unwrap();
    let resume =
        || done(with_drivers(&["run".as_ref(), "--resume".as_ref(), broken.as_os_str(), "--json".as_ref()]));
    let refused = resume().exits(4);
    assert!(refused.stderr.contains("description of the rig"), "{}", refused.stderr);
    std::fs::write(&built_in.path, &built_in.text).unwrap();
    let points = resume().exits(0).json()["points"].as_array().unwrap().len();
    assert_eq!(points, 5, "four points and the first again");
}

fn called(program_name: &str, arguments: &[&str]) -> mapper_tests::Finished {
    let mut command = Command::new(program(program_name));
    command.args(arguments).stdin(Stdio::null());
    done(command)
}

/// A driver that is started by hand prints what it is.
#[test]
fn a_driver_started_by_hand_prints_its_help() {
    for name in ["modbus", "opcua", "ak", "lab"] {
        let file = format!("mapper-backend-{name}");
        build_driver(&file);
        // However wide its lines are.
        let help =
            called(&file, &["--help"]).exits(0).stdout.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains("`mapper` starts") && help.contains("docs/"), "{help}");
        let version = called(&file, &["--version"]).exits(0).stdout;
        assert_eq!(version.trim(), format!("{file} {}", env!("CARGO_PKG_VERSION")));
        let wrong = called(&file, &["--hlep"]).exits(2);
        assert!(wrong.stderr.contains("--hlep") && wrong.stdout.is_empty(), "{wrong:?}");
    }
}

/// A mistake in one channel of many is reported at that channel, with its line.
#[test]
fn a_mistake_below_read_is_reported_with_channel_and_line() {
    for (driver, old, new, at, words) in [
        (
            "opcua",
            "P2:    {node: ns=2;s=P2}",
            "P2:    {nod: ns=2;s=P2}",
            "backend.opcua.read.P2",
            "unknown field `nod`",
        ),
        (
            "opcua",
            "P2:    {node: ns=2;s=P2}",
            "P2:    {node: P2}",
            "backend.opcua.read.P2.node",
            "`P2` is not a node id",
        ),
        (
            "modbus",
            "P2:    {register: 8}",
            "P2:    {register: x}",
            "backend.modbus.read.P2.register",
            "expected u16",
        ),
        (
            "modbus",
            "P2:    {register: 8}",
            "P9:    {register: 8}",
            "backend.modbus.read.P9",
            "no channel is called `P9`",
        ),
        ("modbus", "127.0.0.1:5020 ", "localhost:5020 ", "backend.modbus.address", "here 127.0.0.1:5020"),
    ] {
        build_driver(&format!("mapper-backend-{driver}"));
        let campaign = of_the_guide(driver, &[(old, new)]);
        let text = std::fs::read_to_string(&campaign.path).unwrap();
        let line = 1 + text.lines().position(|line| line.contains(new.trim())).unwrap();
        let mut command = with_drivers(&["check".as_ref(), campaign.path.as_os_str()]);
        command.env("PLC_USER", USER).env("PLC_PASSWORD", PASSWORD);
        let finished = done(command).exits(3);
        for part in [at, words, &format!(":{line}:")] {
            assert!(finished.mentions(part), "{part}: {}", finished.stderr);
        }
    }
}
