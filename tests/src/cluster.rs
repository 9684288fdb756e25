//! Slurm on this computer only, as root and without systemd, in a temporary directory. Both daemons are child processes.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A cluster of one node.
pub struct Cluster {
    folder: PathBuf,
    controller: Child,
    node: Child,
}

/// A port without a listener.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// The settings of a private test cluster.
fn configuration(folder: &Path) -> String {
    let host = Command::new("hostname").arg("-s").output().unwrap();
    let host = String::from_utf8(host.stdout).unwrap().trim().to_owned();
    let folder = folder.display();
    format!(
        "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser=root\nSlurmdUser=root\n\
         AuthType=auth/none\nCredType=cred/none\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
         SlurmctldPort={}\nSlurmdPort={}\nStateSaveLocation={folder}/state\nSlurmdSpoolDir={folder}/spool\n\
         SlurmctldPidFile={folder}/slurmctld.pid\nSlurmdPidFile={folder}/slurmd.pid\n\
         SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1\n\
         SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nReturnToService=2\nMailProg=/bin/true\n\
         NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=2000 State=UNKNOWN\n\
         PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP\n",
        free_port(),
        free_port(),
    )
}

fn daemon(folder: &Path, name: &str, arguments: &[&str]) -> Child {
    let log =
        std::fs::File::options().create(true).append(true).open(folder.join(format!("{name}.log"))).unwrap();
    Command::new(name)
        .args(arguments)
        .arg("-f")
        .arg(folder.join("slurm.conf"))
        .stdin(Stdio::null())
        .stdout(log.try_clone().unwrap())
        .stderr(log)
        .spawn()
        .unwrap_or_else(|error| panic!("{name}: {error}; run `cargo xtask test` as root"))
}

impl Cluster {
    /// Starts the cluster and waits until its node is idle.
    pub fn start(folder: &Path) -> Cluster {
        for name in ["state", "spool"] {
            std::fs::create_dir_all(folder.join(name)).unwrap();
        }
        std::fs::write(folder.join("slurm.conf"), configuration(folder)).unwrap();
        let controller = daemon(folder, "slurmctld", &["-D", "-i"]);
        let node = daemon(folder, "slurmd", &["-D"]);
        let cluster = Cluster { folder: folder.to_owned(), controller, node };
        cluster.wait_for("an idle node", || cluster.ask("sinfo", &["-h", "-o", "%T"]).contains("idle"));
        cluster
    }

    /// Restarts the controller with its saved state, as after a change of settings.
    pub fn restart_controller(&mut self) {
        // An orderly shutdown: a kill would lose unsaved state, and Slurm would drain the node.
        assert!(Command::new("kill").arg(self.controller.id().to_string()).status().unwrap().success());
        self.controller.wait().unwrap();
        self.controller = daemon(&self.folder, "slurmctld", &["-D"]);
        self.wait_for("the controller", || self.ask("scontrol", &["ping"]).contains(" UP"));
    }

    /// Makes a command use this Slurm cluster.
    pub fn on(&self, mut command: Command) -> Command {
        command.env("SLURM_CONF", self.folder.join("slurm.conf"));
        command
    }

    /// Runs a Slurm command and returns its output.
    pub fn ask(&self, program: &str, arguments: &[&str]) -> String {
        let mut command = Command::new(program);
        command.args(arguments);
        let output = self.on(command).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Waits for a condition: a real scheduler needs real time.
    pub fn wait_for(&self, condition: &str, is_so: impl Fn() -> bool) {
        let started = Instant::now();
        while !is_so() {
            let log = || std::fs::read_to_string(self.folder.join("slurmctld.log")).unwrap_or_default();
            assert!(started.elapsed() < LONGEST, "no {condition} after {LONGEST:?}:\n{}", log());
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

/// Timeout for a loaded computer.
const LONGEST: Duration = Duration::from_secs(300);

impl Drop for Cluster {
    fn drop(&mut self) {
        for child in [&mut self.controller, &mut self.node] {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
