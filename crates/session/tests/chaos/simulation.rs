//! One simulation: lives of the program, each with its own faults, over the same files.

use super::check::{self, StatedEnd};
use super::scenario::{Damage, Extent, Kind, Life, Scenario};
use super::world::{Ledger, RIG, SimulatedRig, World};
use mapper_campaign::Campaign;
use mapper_core::{Backend, Clock, PacedClock, StepMarker, UnpacedClock};
use mapper_physics::simulation::model::Model;
use mapper_session::{
    InterruptedRun, Registry, RigStates, RunRequest, Session, SessionError, SessionEvent, nominal_model,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

const SCRIPT: &str = "for p in grid() { jump(p); }\n";

/// A campaign of four short steps.
struct Prepared {
    campaign: Campaign,
    text: String,
    /// The same campaign on the plain lab, to make the rig.
    lab: Campaign,
    model: Model,
    /// Its plan, so that it is made once.
    plan: PathBuf,
    extents: [Extent; 2],
    points: usize,
}

pub struct Simulator {
    campaigns: BTreeMap<Kind, Prepared>,
    folder: tempfile::TempDir,
}

/// What became of one seed.
pub struct Outcome {
    /// How each life ended, in one word.
    pub ends: Vec<String>,
    pub kills: usize,
    pub violation: Option<String>,
}

/// One life, as it went.
pub struct Lived {
    pub stated: StatedEnd,
    pub ledger: Ledger,
    pub is_killed: bool,
    /// Whether an earlier run had left the rig without releasing it.
    pub was_abandoned: bool,
    /// Steps that ended and were not abandoned, as reported.
    pub ended: Vec<StepMarker>,
    /// The directory of the run, if there is one.
    pub directory: Option<PathBuf>,
    pub extent: Extent,
}

pub fn is_on_demand(payload: &(dyn std::any::Any + Send)) -> bool {
    payload.is::<super::faulty_backend::RequestedPanic>()
}

fn campaign(kind: Kind, backend: &str) -> (Campaign, String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/turbo_a.yaml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    let soak = match kind {
        Kind::Soaked => "zero: {soak: 60 s, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n",
        _ => "",
    };
    let script = if kind == Kind::Script { "sequence: along.rhai\n" } else { "" };
    let end = format!("{script}repeats: off\nreturn_to_first: false\nseed: 1 ");
    for (old, new) in [
        (
            "[50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "[80 krpm, 110 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]"),
        ("warm_up: 2 min ", "warm_up: 5 s "),
        ("dwell: 40 s ", "dwell: 20 s "),
        ("order: thermal_gradient ", "order: listed "),
        ("method: joint ", "method: dynamic "),
        ("  formats: [csv, json, svg]\n", "  formats: []\n"),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", soak),
        ("  virtual_lab: {}", backend),
        ("seed: 1 ", &end),
    ] {
        assert_eq!(text.matches(old).count(), 1, "{old}");
        text = text.replace(old, new);
    }
    let files = |path: &Path| match path.ends_with("along.rhai") {
        true => Ok(SCRIPT.to_owned()),
        false => Err(std::io::ErrorKind::NotFound.into()),
    };
    let campaign =
        mapper_campaign::check(&text, &path, &files).unwrap_or_else(|findings| panic!("{findings}"));
    (campaign, text)
}

fn registry() -> Registry {
    Registry {
        backends: vec![mapper_backends::virtual_lab::PLUGIN],
        effects: mapper_effects::catalogue(),
        ..Registry::empty()
    }
}

impl Simulator {
    pub fn new() -> Simulator {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
        let mut simulator = Simulator { campaigns: BTreeMap::new(), folder: folder.unwrap() };
        for kind in [Kind::Grid, Kind::Soaked, Kind::Script] {
            let (campaign, text) = campaign(kind, "  sim: {}");
            let (lab, _) = self::campaign(kind, "  virtual_lab: {}");
            let model = nominal_model(&campaign).unwrap();
            let plan = simulator.folder.path().join(format!("{kind:?}.json"));
            let nothing = Extent { calls: 0, writes: 0, bytes: 0, duration_s: 0.0 };
            let prepared = Prepared { campaign, text, lab, model, plan, extents: [nothing; 2], points: 4 };
            simulator.campaigns.insert(kind, prepared);
            for is_real_time in [false, true] {
                let scenario = Scenario { kind, is_real_time, is_exclusive: true, lives: Vec::new() };
                let folder = simulator.folder.path().join(format!("{kind:?}-{is_real_time}"));
                let lived = simulator.live(&scenario, &Life::undisturbed(is_real_time), &folder, None);
                let run = lived.directory.clone().unwrap();
                assert!(
                    matches!(lived.stated, StatedEnd::Ended(mapper_core::RunEnding::Completed)),
                    "{:?}",
                    lived.stated
                );
                let prepared = simulator.campaigns.get_mut(&kind).unwrap();
                prepared.extents[usize::from(is_real_time)] = lived.extent;
                if kind != Kind::Script && !prepared.plan.exists() {
                    // A plan without a rig fits any.
                    let text = std::fs::read_to_string(run.join("plan.json")).unwrap();
                    let mut plan: serde_json::Value = serde_json::from_str(&text).unwrap();
                    plan["made_from"]["rig_sha256"] = serde_json::Value::Null;
                    std::fs::write(&prepared.plan, plan.to_string()).unwrap();
                }
                check::life(&scenario, &Life::undisturbed(is_real_time), &lived, &folder.join("live"))
                    .unwrap();
            }
        }
        simulator
    }

    /// One start of the program, up to its end or its kill.
    fn live(&self, scenario: &Scenario, life: &Life, folder: &Path, resume: Option<(&Path, bool)>) -> Lived {
        let prepared = &self.campaigns[&scenario.kind];
        let (live, kept) = (folder.join("live"), folder.join("kept"));
        std::fs::create_dir_all(&live).unwrap();
        let world = World::new(life, &live, &kept);
        let lab_registry = registry();
        let (lab, model) = (prepared.lab.clone(), prepared.model.clone());
        let (rig_world, rig_life, is_exclusive) = (world.clone(), life.clone(), scenario.is_exclusive);
        let (disk_world, plan) = (world.clone(), prepared.plan.exists().then_some(prepared.plan.as_path()));
        let registry = Registry {
            driver: Some(Arc::new(move |_, _| {
                let lab = lab_registry.make_backend(&lab, &model).unwrap();
                Ok(Box::new(SimulatedRig::new(lab, &rig_world, &rig_life, is_exclusive)) as Box<dyn Backend>)
            })),
            disk: Some(Arc::new(move |path: &Path, bytes: usize| disk_world.write(path, bytes))),
            ..registry()
        };
        let ended = Mutex::new(Vec::new());
        let on_event = |event: &SessionEvent| {
            if let (SessionEvent::StepEnded(marker), false) = (event, world.is_killed()) {
                ended.lock().unwrap().push(*marker);
            }
            world.call();
        };
        let session = Session {
            on_event: &on_event,
            stop: &world.stop,
            stop_after_step: &world.stop_after_step,
            ..Session::new(&registry)
        };
        let (runs, states) = (live.join("runs"), live.join("states"));
        let was_abandoned = RigStates::new(&states).status(RIG).unwrap().owner.is_some();
        let run = || {
            let resumed = resume.map(|(run, repeats_lost)| {
                let mut run = InterruptedRun::read(run)?;
                run.repeats_lost = repeats_lost;
                Ok::<_, SessionError>(run)
            });
            let request = RunRequest {
                plan: plan.filter(|_| resume.is_none()),
                rig_states: Some(&states),
                started_ns: 1_000_000_000,
                resume: resumed.transpose()?,
                ..RunRequest::new(&prepared.campaign, &prepared.text, &runs)
            };
            let prepared = session.prepare(request)?;
            let (mut unpaced, mut paced) = (UnpacedClock, PacedClock::new(&*world, 1.0));
            let clock: &mut dyn Clock = if life.is_real_time { &mut paced } else { &mut unpaced };
            prepared.run_paced(&session, clock, life.is_real_time)
        };
        let stated = match run() {
            Ok(outcome) => match (outcome.end, outcome.results) {
                (Ok(end), results) => {
                    let is_complete = results.is_ok();
                    let stated = StatedEnd::Ended(end);
                    if is_complete || !stated.is_complete() {
                        stated
                    } else {
                        StatedEnd::NoResults(results.err().unwrap().to_string())
                    }
                }
                (Err(error), _) => StatedEnd::Failed {
                    is_unknown: error.leaves_rig_state_unknown(),
                    error: error.to_string(),
                },
            },
            Err(SessionError::NotArmed(error)) => {
                StatedEnd::NotArmed { is_unknown: error.leaves_rig_state_unknown(), error: error.to_string() }
            }
            Err(error) => StatedEnd::Refused(Box::new(error)),
        };
        let (calls, writes) = world.count();
        let is_killed = world.is_killed();
        if is_killed {
            std::fs::remove_dir_all(&live).unwrap();
            std::fs::rename(&kept, &live).unwrap();
        }
        let ledger = world.take_ledger();
        let directory =
            std::fs::read_dir(&runs).ok().and_then(|entries| entries.flatten().map(|e| e.path()).max());
        let bytes = directory.as_ref().map_or(0, |run| {
            std::fs::read_dir(run).unwrap().flatten().map(|file| file.metadata().unwrap().len()).sum()
        });
        let extent = Extent { calls, writes, bytes, duration_s: ledger.now_s };
        Lived {
            stated,
            is_killed,
            was_abandoned,
            ended: ended.into_inner().unwrap(),
            directory,
            extent,
            ledger,
        }
    }

    /// Simulates what follows from a seed.
    pub fn simulate(&self, seed: u64) -> Outcome {
        let extent = |kind, is_real_time| self.campaigns[&kind].extents[usize::from(is_real_time)];
        let scenario = Scenario::draw(seed, extent);
        let folder = self.folder.path().join(seed.to_string());
        let mut outcome = Outcome { ends: Vec::new(), kills: 0, violation: None };
        let went = self.lives(&scenario, &folder, &mut outcome);
        outcome.violation = went.err().map(|why| format!("{why}\n{scenario:#?}"));
        if outcome.violation.is_none() {
            std::fs::remove_dir_all(&folder).unwrap();
        }
        outcome
    }

    fn lives(&self, scenario: &Scenario, folder: &Path, outcome: &mut Outcome) -> Result<(), String> {
        let states = RigStates::new(&folder.join("live/states"));
        let points = self.campaigns[&scenario.kind].points;
        let mut resume: Option<PathBuf> = None;
        let mut damages = Vec::new();
        let mut was_killed = false;
        // After the drawn lives the operator lets the run go on without further faults.
        let last = Life::undisturbed(scenario.is_real_time);
        for life in scenario.lives.iter().chain([&last]) {
            let mut repeats_lost = false;
            let lived = loop {
                let lived =
                    self.live(scenario, life, folder, resume.as_deref().map(|run| (run, repeats_lost)));
                let StatedEnd::Refused(error) = &lived.stated else { break lived };
                if lived.is_killed {
                    break lived;
                }
                let status = states.status(RIG).map_err(|error| error.to_string())?;
                match check::refusal(error, &lived, resume.as_deref(), &damages, &status, points, was_killed)
                {
                    check::Refusal::Wrong(why) => return Err(why),
                    check::Refusal::Failed => break lived,
                    check::Refusal::Complete => return Ok(()),
                    check::Refusal::RepeatLost if repeats_lost => {
                        return Err(format!("refused again: {error}"));
                    }
                    check::Refusal::RepeatLost => repeats_lost = true,
                    // The operator has inspected the rig.
                    check::Refusal::Acknowledge => {
                        drop(states.acknowledge(RIG).map_err(|error| error.to_string())?)
                    }
                    // Nothing to go on with: a new run.
                    check::Refusal::StartAgain => {
                        resume = None;
                        damages.clear();
                        std::fs::remove_dir_all(folder.join("live/runs")).unwrap();
                    }
                }
            };
            outcome.ends.push(lived.word());
            outcome.kills += usize::from(lived.is_killed);
            was_killed |= lived.is_killed;
            check::life(scenario, life, &lived, &folder.join("live"))?;
            if lived.stated.is_complete() && !lived.is_killed {
                return check::whole(&lived.directory.unwrap(), points);
            }
            if let (true, Some(run), Some(damage)) = (lived.is_killed, &lived.directory, life.damage)
                && apply(damage, run)
            {
                damages.push(damage);
            }
            resume = lived.directory.filter(|run| run.join("journal.jsonl").exists());
            if resume.is_none() {
                damages.clear();
                let _ = std::fs::remove_dir_all(folder.join("live/runs"));
            }
        }
        Err("the run was never complete".to_owned())
    }
}

impl Lived {
    fn word(&self) -> String {
        if self.is_killed { "killed".to_owned() } else { self.stated.word() }
    }
}

/// Damages a file; whether there was one.
fn apply(damage: Damage, run: &Path) -> bool {
    let files = std::fs::read_dir(run).unwrap().flatten().map(|entry| entry.path());
    let newest = files.filter(|path| path.extension().is_some_and(|end| end == "mcap")).max_by_key(|path| {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        (name.len(), name)
    });
    let cut = |path: &Path, share: f64| {
        let file = std::fs::OpenOptions::new().write(true).open(path).unwrap();
        file.set_len((share * file.metadata().unwrap().len() as f64) as u64).unwrap();
    };
    let journal = run.join("journal.jsonl");
    match (damage, newest) {
        (Damage::JournalCut(share), _) if journal.exists() => cut(&journal, share),
        (Damage::JournalCut(_), _) => return false,
        (Damage::JournalGone, _) => drop(std::fs::remove_file(&journal)),
        (_, None) => return false,
        (Damage::Cut(share), Some(path)) => cut(&path, share),
        (Damage::Gone, Some(path)) => std::fs::remove_file(&path).unwrap(),
    }
    true
}
