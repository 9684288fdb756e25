"""How long a signal takes, in each phase of a run, and in the other commands.

    cargo build --release
    target/python-env/bin/python benches/stops.py --mapper target/release/mapper

Each row: the phase, the signal, and the time to what it promises, median and worst of several. In a run with a rig this is the first
command of the safe state, which is sent before it is reported: the time to its event is an upper bound. Elsewhere it is the end of the
process, or the message that results are still written.
"""

import argparse
import json
import os
import queue
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from machines import ROOT

INT, TERM = signal.SIGINT, signal.SIGTERM


class Process:
    """A command with its progress as events."""

    def __init__(self, mapper, arguments, folder):
        environment = {**os.environ, "MAPPER_STATE_DIR": str(folder / "state")}
        self.child = subprocess.Popen(
            [mapper, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment, cwd=ROOT
        )
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

    def send(self, number):
        self.child.send_signal(number)
        return time.monotonic()


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
SURGE = ("seed: 1 ", "surge_search: {}\nseed: 1 ")


def in_run(mapper, folder, replaced, pace, begins, signals, rng):
    """From the last signal to the event of the interruption."""
    arguments = ["run", campaign(folder, *replaced), "--out", folder / "runs", "--progress", "json"]
    process = Process(mapper, [*arguments, *(["--pace", pace] if pace else [])], folder)
    process.until(begins)
    time.sleep(rng.uniform(0.05, 0.5))
    for number in signals[:-1]:
        process.send(number)
        # Two equal signals that wait for one process are one.
        time.sleep(0.05)
    sent = process.send(signals[-1])
    at = process.until(event("interrupted"))
    process.ended()
    return at - sent


def to_end(mapper, folder, arguments, delay_s, signals):
    process = Process(mapper, arguments, folder)
    time.sleep(delay_s)
    if process.child.poll() is not None:
        raise EOFError
    for number in signals[:-1]:
        process.send(number)
        time.sleep(0.05)
    sent = process.send(signals[-1])
    return process.ended() - sent


def results(mapper, folder, signals, rng):
    """Identification and report: from the last step's end."""
    text = ("method: joint ", "method: joint ")
    process = Process(mapper, ["run", campaign(folder, text, SHORT_SOAK), "--out", folder / "runs", "--progress", "json"], folder)
    process.until(event("rig_released"))
    for number in signals:
        time.sleep(0.05)
        sent = process.send(number)
    if len(signals) == 1:
        at = process.until(lambda line: "results are being written" in line)
        process.ended()
        return at - sent
    return process.ended() - sent


def phases(mapper):
    step, soak = event("step_started"), event("soak_started")
    run = lambda *more: lambda folder, rng: in_run(mapper, folder, *more, rng)
    script = ("seed: 1 ", "sequence: long.rhai\nseed: 1 ")

    def scripted(signals):
        def measure(folder, rng):
            (folder / "long.rhai").write_text("for p in grid() { jump(p); let s = 0.0; for i in 0..200000 { s += i.to_float(); } }\n")
            return in_run(mapper, folder, [script, SHORT_SOAK], 200, event("step_ended"), signals, rng)

        return measure

    plan = lambda signals: lambda folder, rng: to_end(mapper, folder, ["run", ROOT / "campaigns/turbo_a.yaml", "--out", folder / "runs"], rng.uniform(0.1, 0.4), signals)
    command = lambda arguments, signals, wait: lambda folder, rng: to_end(mapper, folder, arguments(folder), rng.uniform(*wait), signals)
    fleet = lambda folder: ["fleet", "run", made_fleet(mapper, folder)]
    nightly = lambda folder: ["nightly", ROOT / "campaigns/nightly.yaml", "--db", folder / "history.db"]
    return [
        ("planning", "Ctrl-C", plan([INT])),
        ("planning", "SIGTERM", plan([TERM])),
        ("soak (zero), real time", "Ctrl-C", run([], 1, soak, [INT])),
        ("soak (zero), real time", "SIGTERM", run([], 1, soak, [TERM])),
        ("step, real time", "SIGTERM", run([("zero: {soak: 30 min, evenness: 0.01 K, pressure_evenness: 1 Pa}", ""), ("warm_up: 2 min", "warm_up: 1 s")], 1, step, [TERM])),
        ("step, real time", "Ctrl-C twice", run([("zero: {soak: 30 min, evenness: 0.01 K, pressure_evenness: 1 Pa}", ""), ("warm_up: 2 min", "warm_up: 1 s")], 1, step, [INT, INT])),
        ("a script computes", "Ctrl-C", scripted([INT])),
        ("a script computes", "SIGTERM", scripted([TERM])),
        ("surge search", "SIGTERM", run([SURGE, SHORT_SOAK], 300, lambda line: '"approach"' in line, [TERM])),
        ("identification and report", "Ctrl-C (message)", lambda folder, rng: results(mapper, folder, [INT], rng)),
        ("identification and report", "twice (end)", lambda folder, rng: results(mapper, folder, [INT, INT], rng)),
        ("nightly", "Ctrl-C twice", command(nightly, [INT, INT], (1.0, 3.0))),
        ("nightly", "SIGTERM", command(nightly, [TERM], (1.0, 3.0))),
        ("fleet run", "Ctrl-C twice", command(fleet, [INT, INT], (0.5, 2.0))),
        ("fleet run", "SIGTERM", command(fleet, [TERM], (0.5, 2.0))),
    ]


def made_fleet(mapper, folder):
    study = folder / "study.yaml"
    study.write_text(f"fleet: stops\nstudy: maps\ncampaigns: [{ROOT / 'campaigns/nightly/turbo_a.yaml'}]\nseeds: [1, 2, 3, 4, 5, 6, 7, 8]\n")
    made = subprocess.run([mapper, "fleet", "make", str(study), "--out", str(folder / "fleet")], capture_output=True, text=True, cwd=ROOT)
    assert made.returncode == 0, made.stderr
    return folder / "fleet"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--tries", type=int, default=5)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    mapper = str(Path(arguments.mapper).resolve())
    print("| phase | signal | median, ms | worst, ms |\n|---|---|---:|---:|", flush=True)
    for phase, name, measure in phases(mapper):
        if arguments.only not in phase:
            continue
        times = []
        for seed in range(arguments.tries):
            with tempfile.TemporaryDirectory() as scratch:
                try:
                    times.append(1e3 * measure(Path(scratch), random.Random(seed)))
                except (EOFError, queue.Empty) as error:
                    print(f"{phase}, {name}: {type(error).__name__}", file=sys.stderr, flush=True)
        if times:
            print(f"| {phase} | {name} | {statistics.median(times):.0f} | {max(times):.0f} |", flush=True)


if __name__ == "__main__":
    main()
