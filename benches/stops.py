"""How long a stop takes, in each phase of a run and for each way to ask for it, and in the other commands.

    cargo build --release --locked
    target/python-env/bin/python benches/stops.py --mapper target/release/mapper

In a run with a rig, the time is that from the request to the event of the first command of the safe state, which is sent before it is
reported: an upper bound. Of a rig behind a driver it is the time at which the driver receives that command. While the rig is connected, it is the message that it has no setpoint yet; the safe command then follows the
connection, and the time between is another row. Elsewhere it is the end of the process, or the message that results are still written.
"""

import argparse
import json
import os
import queue
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

from machines import ROOT

INT, TERM, HUP, QUIT, USR1 = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1
SAFE, STOP = "/ask/safe", "/ask/stop"
ARMS_S = 2.0
# It computes for most of its time.
LONG_SCRIPT = "for p in grid() { jump(p); let s = 0.0; for i in 0..200000 { s += i.to_float(); } }\n"
# The Python example rig, which takes its time to be armed.
SLOW_RIG = f"""#!{sys.executable}
import importlib.machinery, importlib.util, pathlib, sys, time
sys.path.insert(0, {str(ROOT / "plugins/drivers/python")!r})
loader = importlib.machinery.SourceFileLoader("rig", {str(ROOT / "plugins/drivers/python/mapper-backend-python_rig")!r})
module = importlib.util.module_from_spec(importlib.util.spec_from_loader("rig", loader))
loader.exec_module(module)
class Slow(module.PythonRig):
    def arm(self):
        pathlib.Path(__file__).with_name("arms").touch()
        time.sleep({ARMS_S})
        armed = super().arm()
        pathlib.Path(__file__).with_name("armed").touch()
        return armed
    def set(self, setpoints):
        file = pathlib.Path(__file__).with_name("cooled")
        if not file.exists() and getattr(self, "t3_k", 0.0) > 1.1 * setpoints["t3_k"]:
            file.write_text(str(time.time()))
        self.t3_k = setpoints["t3_k"]
        return super().set(setpoints)
if __name__ == "__main__":
    module.serve("slow_rig", "1.0", Slow)
"""


class Process:
    """A command with its progress as events."""

    def __init__(self, mapper, arguments, folder):
        path = f"{folder}{os.pathsep}{os.environ['PATH']}"
        environment = {**os.environ, "MAPPER_STATE_DIR": str(folder / "state"), "PATH": path}
        self.child = subprocess.Popen(
            [mapper, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment, cwd=ROOT
        )
        self.page = None
        self.lines = queue.Queue()
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.child.stderr:
            self.lines.put((time.monotonic(), line))
        self.lines.put((time.monotonic(), None))

    def until(self, found, seconds=300):
        """The time of the first line for which `found` is true."""
        end = time.monotonic() + seconds
        while True:
            at, line = self.lines.get(timeout=max(end - time.monotonic(), 0.01))
            if line is None:
                raise EOFError
            if found(line):
                return at

    def ended(self):
        self.child.wait(timeout=300)
        return time.monotonic()

    def ask(self, requests):
        """Asks to stop by signals or buttons of the page; the time of the last request."""
        for number, request in enumerate(requests):
            if number > 0:
                # Two equal signals that wait for one process are one.
                time.sleep(0.05)
            if self.child.poll() is not None:
                raise EOFError
            asked = time.monotonic()
            if isinstance(request, str):
                urllib.request.urlopen(urllib.request.Request(self.page + request, b"", {"Origin": self.page}), timeout=10)
            else:
                self.child.send_signal(request)
        return asked


def campaign(folder, *replaced):
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    text = text.replace("[50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "[80 krpm, 110 krpm]")
    text = text.replace("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]")
    for before, after in replaced:
        assert before in text, before
        text = text.replace(before, after)
    path = folder / "campaign.yaml"
    path.write_text(text)
    return path


def event(*kinds):
    def found(line):
        try:
            value = json.loads(line)
        except ValueError:
            return False
        return any(kind in (value.get("event"), value.get("kind")) for kind in kinds)

    return found


SHORT_SOAK = ("soak: 30 min", "soak: 5 min")
NO_SOAK = ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}", "")
SHORT_WARM_UP = ("warm_up: 2 min", "warm_up: 1 s")
SURGE = ("seed: 1 ", "surge_search: {}\nseed: 1 ")
SCRIPT = ("seed: 1 ", "sequence: long.rhai\nseed: 1 ")
SLOW = ("  virtual_lab: {}", "  slow_rig: {real_time: true}")
CONNECTING = lambda line: "while the rig is being connected" in line


def in_run(replaced, pace, begins, ends=event("interrupted"), since=None, until=None):
    """From the last request, or from the file `since`, to the event of the interruption or another line, or to the time in the file `until`."""

    def measure(mapper, folder, requests, rng):
        (folder / "long.rhai").write_text(LONG_SCRIPT)
        driver = folder / "mapper-backend-slow_rig"
        driver.write_text(SLOW_RIG)
        driver.chmod(0o755)
        arguments = ["run", campaign(folder, *replaced), "--out", folder / "runs", "--progress", "json"]
        arguments += ["--pace", pace] if pace else []
        page = None
        if any(isinstance(request, str) for request in requests):
            with socket.socket() as free:
                free.bind(("127.0.0.1", 0))
                address = f"127.0.0.1:{free.getsockname()[1]}"
            arguments, page = [*arguments, f"--live={address}"], f"http://{address}"
        process = Process(mapper, arguments, folder)
        process.page = page
        if begins is None:
            while not (folder / "arms").exists():
                time.sleep(0.005)
        else:
            process.until(begins)
        time.sleep(rng.uniform(0.05, 0.5))
        asked = process.ask(requests)
        at = process.until(ends)
        if since is not None:
            asked = time.monotonic() - time.time() + (folder / since).stat().st_mtime
        if until is not None:
            at = float((folder / until).read_text()) - time.time() + time.monotonic()
        # The run-down takes seconds in real time.
        process.child.kill()
        process.child.wait()
        return at - asked

    return measure


def to_end(arguments, wait_s):
    def measure(mapper, folder, requests, rng):
        process = Process(mapper, arguments(mapper, folder), folder)
        time.sleep(rng.uniform(*wait_s))
        asked = process.ask(requests)
        return process.ended() - asked

    return measure


def results(mapper, folder, requests, rng):
    """Identification and report: the message after one request, the end after two."""
    process = Process(mapper, ["run", campaign(folder, SHORT_SOAK), "--out", folder / "runs", "--progress", "json"], folder)
    process.until(event("rig_released"))
    time.sleep(0.05)
    asked = process.ask(requests)
    at = process.until(lambda line: "results are being written" in line) if len(requests) == 1 else process.ended()
    process.ended()
    return at - asked


def made_fleet(mapper, folder):
    study = folder / "study.yaml"
    study.write_text(f"fleet: stops\nstudy: maps\ncampaigns: [{ROOT / 'campaigns/nightly/turbo_a.yaml'}]\nseeds: [1, 2, 3, 4, 5, 6, 7, 8]\n")
    made = subprocess.run([mapper, "fleet", "make", str(study), "--out", str(folder / "fleet")], capture_output=True, text=True, cwd=ROOT)
    assert made.returncode == 0, made.stderr
    return ["fleet", "run", folder / "fleet"]


COLUMNS = {"Ctrl-C": [INT], "Ctrl-C twice": [INT, INT], "SIGTERM": [TERM], "SIGHUP": [HUP], "SIGQUIT": [QUIT], "SIGUSR1": [USR1],
           "page: stop": [STOP], "page: safe": [SAFE]}
NOW = ["Ctrl-C", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1", "page: stop", "page: safe"]
IN_STEP = ["Ctrl-C twice", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1", "page: safe"]
ENDS = ["Ctrl-C", "SIGTERM", "SIGHUP"]
PLAN = lambda _, folder: ["run", ROOT / "campaigns/turbo_a.yaml", "--out", folder / "runs"]
NIGHTLY = lambda _, folder: ["nightly", ROOT / "campaigns/nightly.yaml", "--db", folder / "history.db"]
PHASES = [
    ("planning", to_end(PLAN, (0.1, 0.4)), ENDS),
    (f"connecting, {ARMS_S:.0f} s: message", in_run([SLOW, NO_SOAK], None, None, CONNECTING), ["Ctrl-C", "SIGTERM"]),
    ("armed to safe command", in_run([SLOW, NO_SOAK], None, None, since="armed"), ["Ctrl-C", "SIGTERM"]),
    ("soak (zero)", in_run([], 1, event("soak_started")), NOW),
    ("warm-up", in_run([NO_SOAK], 1, event("rig_time")), NOW),
    ("step", in_run([NO_SOAK, SHORT_WARM_UP], 1, event("step_started")), IN_STEP),
    ("step, command at a driver", in_run([SLOW, NO_SOAK, SHORT_WARM_UP], None, event("step_started"), until="cooled"), IN_STEP),
    ("a script computes", in_run([SCRIPT, SHORT_SOAK], 200, event("step_ended")), NOW),
    ("surge search", in_run([SURGE, SHORT_SOAK], 300, lambda line: '"approach"' in line), IN_STEP),
    ("results: message", results, ["Ctrl-C", "SIGTERM"]),
    ("results: end", results, ["Ctrl-C twice"]),
    ("`nightly`", to_end(NIGHTLY, (1.0, 3.0)), ["Ctrl-C twice", "SIGTERM"]),
    ("`fleet run`", to_end(made_fleet, (0.5, 2.0)), ["Ctrl-C twice", "SIGTERM"]),
]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--tries", type=int, default=5)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    mapper = str(Path(arguments.mapper).resolve())
    print("Median and worst of", arguments.tries, "in ms\n")
    print("| phase | " + " | ".join(COLUMNS) + " |\n|---|" + "---:|" * len(COLUMNS), flush=True)
    for phase, measure, columns in PHASES:
        if arguments.only not in phase:
            continue
        cells = []
        for column, requests in COLUMNS.items():
            times = []
            for seed in range(arguments.tries if column in columns else 0):
                with tempfile.TemporaryDirectory() as scratch:
                    try:
                        times.append(1e3 * measure(mapper, Path(scratch), requests, random.Random(seed)))
                    except (EOFError, OSError, queue.Empty) as error:
                        print(f"{phase}, {column}: {type(error).__name__} {error}", file=sys.stderr, flush=True)
            cells.append(f"{statistics.median(times):.0f}, {max(times):.0f}" if times else "")
        print(f"| {phase} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
