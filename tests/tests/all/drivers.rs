//! Rigs with drivers: separate programs with the protocol of docs/reference/protocol.md.
#![cfg(unix)]

use crate::interrupted::Running;
use mapper_core::EventKind;
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_tests::{
    CampaignFile, Finished, SHORT_GRID, SINGLE_STEP_METHOD, build_drivers, mapper_command, repository,
    shared_run,
};
use notify::{RecursiveMode, Watcher};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// The shipped campaign on four points, each step by itself, with another backend.
pub(crate) fn short(backend: &str) -> CampaignFile {
    let own = [("  virtual_lab: {}", backend)];
    let replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).chain(&own).copied().collect();
    CampaignFile::shipped_with(&replacements)
}

/// The lab of another campaign, behind its driver.
fn lab(of: &CampaignFile, more: &str) -> CampaignFile {
    short(&format!("  lab: {{campaign: {}{more}}}", of.path.display()))
}

/// `mapper` where the drivers in Python are on the path too.
pub(crate) fn with_drivers(arguments: &[&std::ffi::OsStr]) -> Command {
    build_drivers();
    let mut command = mapper_command(arguments.iter().copied());
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places =
        [repository().join("plugins/drivers/python")].into_iter().chain(std::env::split_paths(&path));
    // Drivers in Python find the packages of the tests.
    let python = option_env!("MAPPER_TEST_PYTHON").and_then(|python| Path::new(python).parent());
    let places = python.map(Path::to_path_buf).into_iter().chain(places);
    command.env("PATH", std::env::join_paths(places).unwrap()).env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

pub(crate) fn done(mut command: Command) -> Finished {
    command.output().unwrap().into()
}

fn run(campaign: &CampaignFile) -> Value {
    let runs = campaign.runs();
    let arguments =
        ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), runs.as_os_str()];
    done(with_drivers(&arguments)).exits(0).json()
}

fn check(name: &str, campaign: &CampaignFile) {
    let arguments = ["backend", "check", name, "--campaign"].map(std::ffi::OsStr::new);
    let arguments: Vec<_> = arguments.into_iter().chain([campaign.path.as_os_str()]).collect();
    let finished = done(with_drivers(&arguments));
    assert!(!finished.stdout.contains("BROKEN"), "{}", finished.stdout);
    assert_eq!(finished.exits(0).stdout.lines().count(), 13);
}

/// The campaign differs only in its backend: the points are identical to the last digit.
#[test]
fn the_lab_behind_its_driver_gives_the_points_of_the_lab() {
    let built_in = short("  virtual_lab: {}");
    let behind = lab(&built_in, "");
    let (expected, found) = (shared_run(&built_in).result, run(&behind));
    assert_eq!(expected["points"].as_array().unwrap().len(), 4);
    assert_eq!(found["points"], expected["points"]);
}

/// The campaign does not contain the location of the driver: a socket in the user's state directory takes precedence over a program.
#[test]
fn a_driver_at_a_socket_is_found_and_gives_the_points_of_the_lab() {
    build_drivers();
    let states = mapper_tests::scratch();
    let socket = states.path().join("drivers/lab.socket");
    let program = Path::new(mapper_command([""; 0]).get_program()).with_file_name("mapper-backend-lab");
    let listening = Server(Command::new(program).arg("--socket").arg(&socket).spawn().unwrap());
    while !socket.exists() {
        std::thread::yield_now();
    }
    let with = |arguments: &[&std::ffi::OsStr]| {
        let mut command = with_drivers(arguments);
        command.env("MAPPER_STATE_DIR", states.path());
        done(command).exits(0)
    };
    let list = with(&["backend", "list", "--json"].map(AsRef::as_ref)).json();
    let found = list["backends"].as_array().unwrap().iter().find(|one| one["name"] == "lab").unwrap();
    assert_eq!(found["socket"].as_str().unwrap(), socket.to_str().unwrap());
    let built_in = short("  virtual_lab: {}");
    let behind = lab(&built_in, "");
    let runs = behind.runs();
    let run =
        ["run".as_ref(), behind.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), runs.as_os_str()];
    assert_eq!(with(&run).json()["points"], shared_run(&built_in).result["points"]);
    drop(listening);
}

#[test]
fn the_lab_behind_its_driver_keeps_every_rule() {
    check("lab", &lab(&short("  virtual_lab: {}"), ""));
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python: run `cargo xtask test`")]
fn the_rig_in_python_keeps_every_rule_and_gives_the_points_of_the_same_model() {
    let campaign = short("  python_rig: {noise: 1}");
    check("python_rig", &campaign);
    let (found, expected) = (run(&campaign), run(&short("  virtual_lab: {offsets: none}")));
    let (found, expected) = (found["points"].as_array().unwrap(), expected["points"].as_array().unwrap());
    assert_eq!(found.len(), 4);
    let eta = |point: &Value| point["eta"].as_f64();
    let both = found.iter().zip(expected).filter_map(|(found, expected)| Some((eta(found)?, eta(expected)?)));
    let both: Vec<_> = both.collect();
    assert!(both.len() >= 3, "{found:?}");
    for (found, expected) in both {
        // One model, docs/reference/model.md, written twice: noise moves a step by some tenths of a percent.
        assert!((found - expected).abs() < 0.01, "{found} and {expected}");
    }
}

/// A model as a rig: the FMU is built by pythonfmu, stepped by FMPy, and has units and names of its own.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn a_model_keeps_every_rule_and_gives_the_points_of_its_rig() {
    let scratch = mapper_tests::scratch();
    let settings = mapper_tests::python("build_fmu.py", [scratch.path().join("small.fmu")]);
    let campaign = short(&format!("  fmu: {settings}"));
    check("fmu", &campaign);
    // The model is the rig in Python with the noise of its seed: its points are that rig's.
    let (found, expected) = (run(&campaign), run(&short("  python_rig: {noise: 1, seed: 1}")));
    let (found, expected) = (found["points"].as_array().unwrap(), expected["points"].as_array().unwrap());
    assert_eq!(found.len(), 4);
    let eta = |point: &Value| point["eta"].as_f64();
    let both = found.iter().zip(expected).filter_map(|(found, expected)| Some((eta(found)?, eta(expected)?)));
    let both: Vec<_> = both.collect();
    assert!(both.len() >= 3, "{found:?}");
    for (found, expected) in both {
        // A set-point reaches it a step later, and its noise falls on other samples then.
        assert!((found - expected).abs() < 0.005, "{found} and {expected}");
    }
    for (old, new, words) in [
        ("shaft.n", "shaft.m", "the model has no variable `shaft.m`"),
        ("small.fmu", "absent.fmu", "cannot be read as an FMU"),
        ("\"p3_set\"", "7", "write the variable of the model"),
    ] {
        let wrong = short(&format!("  fmu: {}", settings.to_string().replace(old, new)));
        let finished = done(with_drivers(&["check".as_ref(), wrong.path.as_os_str()])).exits(3);
        assert!(finished.mentions(words) && finished.stderr.contains("backend.fmu."), "{}", finished.stderr);
    }
}

/// The Python helper with a simulated clock: lease, run-down, retries, limits, invalid bytes, a full pipe.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python: run `cargo xtask test`")]
fn the_python_helper_follows_the_protocol() {
    let held = mapper_tests::python("driver_rules.py", [""; 0]);
    assert_eq!(held["held"].as_array().unwrap().len(), 14, "{held}");
}

#[test]
fn drivers_are_listed_with_their_location_or_build_command() {
    let list = done(with_drivers(&["backend", "list", "--json"].map(AsRef::as_ref))).exits(0).json();
    let of = |name: &str| {
        let all = list["backends"].as_array().unwrap();
        all.iter().find(|one| one["name"] == name).unwrap_or_else(|| panic!("{name}: {list}")).clone()
    };
    assert!(of("virtual_lab")["program"].is_null());
    assert!(of("lab")["program"].as_str().unwrap().ends_with("mapper-backend-lab"));
    assert!(of("python_rig")["program"].as_str().unwrap().contains("plugins/drivers/python"));
    // Alone in a directory, with nothing on the path.
    let alone = mapper_tests::scratch();
    let program = alone.path().join("mapper");
    std::fs::copy(mapper_command([""; 0]).get_program(), &program).unwrap();
    let output = Command::new(&program).args(["backend", "list"]).env("PATH", "").output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    for name in ["modbus", "opcua", "ak"] {
        let joined = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            joined.contains(&format!("cargo build --release --locked -p mapper-backend-{name}")),
            "{text}"
        );
    }
}

#[test]
fn a_missing_driver_and_a_secret_are_reported_at_their_lines() {
    for (backend, words, never) in [
        ("  no_such_rig: {x: 1}", "mapper-backend-no_such_rig", "\u{0}"),
        ("  lab: {campaign: x.yaml, password: hunter2}", "{env: NAME}", "hunter2"),
        ("  lab: {password: {env: MAPPER_TEST_NOT_SET}}", "MAPPER_TEST_NOT_SET is not set", "\u{0}"),
        ("  lab: {real_time: true}", "campaign", "\u{0}"),
    ] {
        let campaign = short(backend);
        let finished = done(with_drivers(&["check".as_ref(), campaign.path.as_os_str()])).exits(3);
        assert!(finished.mentions(words) && finished.stderr.contains('^'), "{}", finished.stderr);
        assert!(!finished.stderr.contains(never), "{}", finished.stderr);
    }
}

/// The commands to the rig, as soon as `reached` holds of them; how long that took.
fn commands(file: &Path, reached: impl Fn(&str) -> bool) -> (String, Duration) {
    let (sender, news) = channel();
    let mut watcher = notify::recommended_watcher(sender).unwrap();
    watcher.watch(file.parent().unwrap(), RecursiveMode::NonRecursive).unwrap();
    let begun = Instant::now();
    loop {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        if reached(&text) {
            return (text, begun.elapsed());
        }
        news.recv_timeout(Duration::from_secs(60)).expect("the rig receives a command").unwrap();
    }
}

/// A run on the lab in real time, with its gas on.
fn running_lab() -> (Running, CampaignFile, CampaignFile, std::path::PathBuf) {
    running_lab_at("10 Hz")
}

fn running_lab_at(rate: &str) -> (Running, CampaignFile, CampaignFile, std::path::PathBuf) {
    build_drivers();
    let built_in = short(&format!("  virtual_lab: {{sample_rate: {rate}}}"));
    let file = built_in.directory().join("commands.txt");
    let campaign = lab(&built_in, &format!(", real_time: true, command_log: {}", file.display()));
    let running = Running::start_with(&campaign, &[]);
    commands(&file, |text| text.contains("set air on"));
    (running, campaign, built_in, file)
}

/// The run-down: heater off with the first command, P3 lowered, then the air cut.
fn assert_run_down(text: &str) {
    let way: Vec<&str> = text.lines().skip_while(|line| !line.contains("T3 293 K")).collect();
    let steps = way.iter().take_while(|line| line.contains("T3 293 K")).count();
    assert!(steps > 2, "P3 goes down at its slew: {text}");
    assert!(way[steps].contains("make safe"), "{text}");
}

/// No host is left to command the rig. The driver does, at once: 2.5 s is what docs/reference/safety.md promises.
#[test]
fn a_runner_that_is_killed_leaves_a_driver_that_makes_the_rig_safe() {
    let (running, _campaign, _built_in, file) = running_lab();
    running.kill();
    let (_, began) = commands(&file, |text| text.contains("T3 293 K"));
    assert!(began < Duration::from_millis(2500), "{began:?}");
    let (text, _) = commands(&file, |text| text.contains("disarm"));
    assert_run_down(&text);
}

/// A runner that hangs keeps its pipes open, so only the lease can end the run.
#[test]
fn a_suspended_runner_loses_its_lease() {
    let (running, _campaign, _built_in, file) = running_lab();
    running.signal("STOP");
    let (text, _) = commands(&file, |text| text.contains("make safe"));
    assert_run_down(&text);
    running.kill();
    commands(&file, |text| text.contains("disarm"));
}

/// The runner resumes after samples were dropped: the run has ended, the rig is safe, and the recording has the reason.
#[test]
fn a_resumed_runner_records_the_samples_that_it_missed() {
    let (running, campaign, _built_in, file) = running_lab_at("500 Hz");
    running.signal("STOP");
    commands(&file, |text| text.contains("make safe"));
    running.signal("CONT");
    let finished = running.wait();
    assert_eq!(finished.code, Some(5), "{}", finished.stderr);
    let recording = mapper_tests::only_run(&campaign.runs()).join("recording.mcap");
    let report = read_recording(&recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
    let events: Vec<_> = report.recording.events.iter().map(|event| (event.kind, &*event.message)).collect();
    // Which reason comes first depends on where the runner was stopped. On a busy computer the driver fills neither queue nor pipe, nothing is
    // missing, and the next set-point is refused; a call that was under way has passed its limit. That missing samples are reported holds in any
    // case: plugins/drivers/lab/tests/unread.rs.
    let reasons = ["are missing", "the lease had ended", "did not answer"];
    let lost = events.iter().position(|(_, words)| reasons.iter().any(|reason| words.contains(reason)));
    let safe = events.iter().position(|(kind, _)| *kind == EventKind::SafeState);
    assert!(lost.is_some() && lost < safe, "{events:#?}");
}

/// What docs/how-to/rig.md shows for a driver, at another port, in the words of a server that shares its machine with tests.
pub(crate) fn of_the_guide(driver: &str, replacements: &[(&str, &str)]) -> CampaignFile {
    let guide = std::fs::read_to_string(repository().join("docs/how-to/rig.md")).unwrap();
    let depth = |line: &str| line.len() - line.trim_start().len();
    let head = format!("{driver}:");
    let at = guide.lines().position(|line| line.trim() == head).unwrap();
    let deep = depth(guide.lines().nth(at).unwrap());
    let settings = guide.lines().skip(at + 1).take_while(|line| depth(line) > deep);
    let mut backend = format!("  {driver}:");
    for line in settings {
        backend += &format!("\n  {}", &line[deep..]);
    }
    for (old, new) in replacements {
        assert_eq!(backend.matches(old).count(), 1, "`{old}` in docs/how-to/rig.md");
        backend = backend.replace(old, new);
    }
    short(&backend)
}

/// A server of tests/python, which ends with its input.
pub(crate) struct Server(std::process::Child);

impl Server {
    /// Starts it; gives its port.
    pub(crate) fn start(script: &str, arguments: &[&str]) -> (Server, String) {
        use std::io::BufRead;
        let mut server = Command::new(option_env!("MAPPER_TEST_PYTHON").unwrap_or("python3"))
            .arg(repository().join("tests/python").join(script))
            .args(arguments)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let mut port = String::new();
        std::io::BufReader::new(server.stdout.take().unwrap()).read_line(&mut port).unwrap();
        (Server(server), port.trim().to_owned())
    }

    pub(crate) fn end(mut self) {
        drop(self.0.stdin.take());
        assert!(self.0.wait().unwrap().success());
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A controller that cannot be reached: reported as that, twice alike. Nothing moved, so no latch waits for an operator, and no empty
/// run is left.
#[test]
fn an_unreachable_rig_leaves_neither_a_lock_nor_a_run() {
    mapper_tests::build_driver("mapper-backend-modbus");
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let campaign = of_the_guide("modbus", &[(":5020 ", &format!(":{port} "))]);
    let states = mapper_tests::scratch();
    let with = |arguments: &[&std::ffi::OsStr]| {
        let mut command = with_drivers(arguments);
        command.env("MAPPER_STATE_DIR", states.path());
        done(command)
    };
    let runs = campaign.runs();
    let run: [&std::ffi::OsStr; 4] =
        ["run".as_ref(), campaign.path.as_ref(), "--out".as_ref(), runs.as_ref()];
    for _ in 0..2 {
        let finished = with(&run).exits(5);
        assert!(finished.stderr.contains("the rig could not be armed"), "{}", finished.stderr);
        assert!(!finished.stderr.contains("identifying"), "{}", finished.stderr);
    }
    assert_eq!(runs.read_dir().map_or(0, Iterator::count), 0);
    let known = with(&["rig", "status", "--json"].map(AsRef::as_ref)).exits(0).json();
    assert!(
        known["rigs"].as_array().unwrap().iter().all(|rig| rig["latch"].is_null() && rig["owner"].is_null()),
        "{known}"
    );
    let typo = with(&["rig", "status", "no such rig"].map(AsRef::as_ref)).exits(0).stdout;
    assert!(typo.contains("not in use") && typo.lines().count() == 2, "{typo}");
}

/// Behind a server that shares no code with the driver, with the settings of the guide, in real time.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn a_rig_behind_modbus_keeps_every_rule() {
    let (server, port) = Server::start("modbus_rig.py", &[]);
    let replacements = [(":5020 ", &*format!(":{port} ")), ("timeout: 200 ms", "timeout: 800 ms")];
    check("modbus", &of_the_guide("modbus", &replacements));
    server.end();
}

/// The same over OPC UA, signed and encrypted, with a pinned certificate; the password appears in no file.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn a_rig_behind_opcua_keeps_every_rule() {
    mapper_tests::build_driver("mapper-backend-opcua");
    let scratch = mapper_tests::scratch();
    let pki = scratch.path().join("pki");
    let (server, port) = Server::start("opcua_rig.py", &["0", "--secure", pki.to_str().unwrap()]);
    let replacements = [(":4840", &*format!(":{port}")), ("timeout: 300 ms", "timeout: 800 ms")];
    let campaign = of_the_guide("opcua", &replacements);
    let state = scratch.path().join("state");
    let as_user = |mut command: Command| {
        command.env("MAPPER_STATE_DIR", &state).env("PLC_USER", "lab").env("PLC_PASSWORD", "hunter2");
        done(command)
    };
    let program = Path::new(mapper_command([""; 0]).get_program()).with_file_name("mapper-backend-opcua");
    let mut trust = Command::new(program);
    trust.args(["trust", &format!("opc.tcp://127.0.0.1:{port}")]);
    as_user(trust).exits(0);
    let arguments = ["backend", "check", "opcua", "--campaign"].map(std::ffi::OsStr::new);
    let arguments: Vec<_> = arguments.into_iter().chain([campaign.path.as_os_str()]).collect();
    let finished = as_user(with_drivers(&arguments));
    assert!(!finished.stdout.contains("BROKEN"), "{}", finished.stdout);
    assert_eq!(finished.exits(0).stdout.lines().count(), 13);
    server.end();
}
