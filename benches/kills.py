"""What is left of a run that is killed at any moment, up to three times, and whether the rest of it makes the same map.

    cargo build --release
    target/python-env/bin/python benches/kills.py --mapper target/release/mapper --short --kills 500

Runs `campaigns/turbo_a.yaml` with its points in the order in which they are listed (planning would take most of the time that kills are
drawn from), and kills it with SIGKILL at a random moment of a random phase: start (planning, connecting), recording (soak, warm-up, steps),
end (identification, writing of results). Then it goes on with `mapper run --resume`, which is killed in the same way up to twice more, until
it is through, and compares with the uninterrupted run:

- steps and soaks whose journal entry holds but which the recordings, cut as they are, do not contain;
- points that are there twice or not at all, and the exit code;
- efficiencies, in standard errors of the difference (a resumed run warms up again and draws other noise);
- whether `identify RUN` gives the points of `RUN/points.json`, `report RUN` its page, and `drift RUN` the answer of the uninterrupted run.
"""

import argparse
import concurrent.futures
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from machines import ROOT, quantile


def points_of(run):
    return json.loads((run / "points.json").read_text())["points"]


def key(point):
    return point["target"]["speed_rpm"], point["target"]["valve"]


def promised_and_lost(run):
    """Steps and soaks that the journal calls saved and that the recordings, cut as they are, do not hold."""
    journal = run / "journal.jsonl"
    lines = journal.read_text(errors="replace").split("\n")[:-1] if journal.exists() else []
    promised, recording, lost = {}, None, 0
    for entry in map(json.loads, lines):
        if isinstance(entry, dict) and "part" in entry:
            recording = entry["part"]["recording"]
            promised[recording] = set()
        elif entry == "soaked":
            promised[recording].add("soak")
        elif isinstance(entry, dict) and "step_saved" in entry:
            promised[recording].add(entry["step_saved"])
    for name, wanted in promised.items():
        lost += len(wanted - held(run / name))
    return lost


def held(recording):
    """Ended steps, and a soak, in a recording that may be cut."""
    ended, topics = set(), {}
    try:
        with open(recording, "rb") as file:
            for record in StreamReader(file, record_size_limit=None).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and topics.get(record.channel_id) == "/step":
                    step = json.loads(record.data)
                    if step["phase"] == "end":
                        ended.add(step["step"])
                elif isinstance(record, Message) and topics.get(record.channel_id) == "/event":
                    if json.loads(record.data)["kind"] == "soak_ended":
                        ended.add("soak")
    except Exception as error:  # The cut end of the file: what came before it was read.
        print(f"the recording ends with: {error}", file=sys.stderr) if not topics else None
    return ended


class Whole:
    """The uninterrupted run."""

    def __init__(self, mapper, campaign, folder):
        begin = time.monotonic()
        self.mapper, self.campaign = mapper, campaign
        process = subprocess.Popen([mapper, "run", str(campaign), "--out", str(folder)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        first_s = last_s = None
        size = 0
        while process.poll() is None:
            found = list(folder.glob("*/recording.mcap"))
            now = found[0].stat().st_size if found else 0
            if now > 0 and first_s is None:
                first_s = time.monotonic() - begin
            if now > size:
                size, last_s = now, time.monotonic() - begin
            time.sleep(0.005)
        assert process.returncode == 0, process.returncode
        self.run = next(folder.iterdir())
        self.bytes = size
        # Durations of the start and of the end, s.
        self.start_s, self.end_s = first_s, time.monotonic() - begin - last_s
        self.points = {key(p): p for p in points_of(self.run) if p["kind"] == "point"}
        self.drift = answer(mapper, "drift", self.run)


def answer(mapper, command, run):
    done = subprocess.run([mapper, command, str(run), "--json"], capture_output=True, text=True)
    return done.returncode, done.stdout


def kill(process, rng, whole, recordings):
    """Kills the process at a random moment of a random phase; returns the phase, or `None` if it ended before."""
    phase = rng.choice(["start", "recording", "recording", "end"])
    begin = time.monotonic()
    before = set(recordings())
    at_bytes, more_s = rng.uniform(0.0, 1.0) * whole.bytes, rng.uniform(0.0, 0.03)
    if phase == "start":
        time.sleep(rng.uniform(0.0, 1.0) * whole.start_s)
    while phase != "start" and process.poll() is None and time.monotonic() - begin < 600:
        new = [path for path in recordings() if path not in before]
        size = new[0].stat().st_size if new else 0
        if size >= (at_bytes if phase == "recording" else 0.99 * whole.bytes):
            break
        time.sleep(0.002)
    time.sleep(more_s if phase != "end" else rng.uniform(0.0, 1.2) * whole.end_s)
    if process.poll() is not None:
        return None
    process.send_signal(signal.SIGKILL)
    process.wait()
    return phase


def killed(mapper, folder, index, whole, again, until):
    """One run, killed and resumed; what is wrong with it."""
    if time.monotonic() > until:
        return {"index": index, "what": "not tried", "kills": []}
    rng = random.Random(index)
    out = folder / f"run-{index}"
    environment = {**os.environ, "MAPPER_STATE_DIR": str(folder / f"state-{index}")}
    recordings = lambda: sorted(out.glob("*/recording*.mcap"))
    start = lambda arguments: subprocess.Popen([mapper, "run", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)
    kills, lost = [], 0
    process = start([str(whole.campaign), "--out", str(out)])
    for _ in range(1 + again):
        phase = kill(process, rng, whole, recordings)
        if phase is None:
            break
        kills.append(phase)
        runs = [path.parent for path in recordings()]
        if runs and not (runs[0] / "report.html").exists():
            lost += promised_and_lost(runs[0])
            process = start(["--resume", str(runs[0])])
        elif runs:
            break
        else:
            process = start([str(whole.campaign), "--out", str(out)])
    error = process.communicate()[1]
    found = {"index": index, "kills": kills, "lost": lost}
    runs = [path.parent for path in recordings()]
    if not runs or not (runs[0] / "report.html").exists():
        return {**found, "what": "not resumed", "why": f"exit {process.returncode}: {(error or '').strip()[-400:]}"}
    run = runs[0]
    points = points_of(run)
    code, text = answer(mapper, "identify", run)
    same = code == 0 and [(key(p), p["eta"]) for p in json.loads(text)["points"]] == [(key(p), p["eta"]) for p in points]
    page = subprocess.run([mapper, "report", str(run), "--out", str(out / "page.html")], capture_output=True, env=environment)
    shown = page.returncode == 0 and (out / "page.html").exists()
    drift = answer(mapper, "drift", run)[0] == whole.drift[0]
    wrong = [name for name, right in [("identify", same), ("report", shown), ("drift", drift)] if not right]
    shutil.rmtree(out)
    return {**found, "what": "through", "points": points, "exit": process.returncode, "wrong": wrong}


def listed(folder, short):
    """The campaign, without a search for the order of its points."""
    text = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    shorter = [
        ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [80 krpm, 110 krpm, 140 krpm]"),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.0, 1.4]"),
        ("method: joint ", "method: dynamic "),
        ("soak: 30 min", "soak: 5 min"),
        ("  dwell: 40 s ", "  dwell: 60 s "),
        ("  formats: [csv, json, svg]\n", "  formats: [csv]\n"),
    ]
    for before, after in (shorter if short else []) + [("order: thermal_gradient ", "order: listed ")]:
        assert before in text, before
        text = text.replace(before, after)
    path = folder / "turbo_a.yaml"
    path.write_text(text)
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=math.inf, help="begins no further one after so long")
    parser.add_argument("--short", action="store_true", help="nine points of a minute, each step by itself, after a short soak")
    parser.add_argument("--again", type=int, default=2, help="further kills of a resumed run")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    mapper = str(Path(arguments.mapper).resolve())
    found = []
    until = time.monotonic() + 60 * arguments.minutes
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        folder = Path(scratch)
        whole = Whole(mapper, listed(folder, arguments.short), folder / "whole")
        seeds = range(arguments.first, arguments.first + arguments.kills)
        for one in pool.map(lambda index: killed(mapper, folder, index, whole, arguments.again, until), seeds):
            found.append(one)
            if len(found) % 20 == 0:
                print(f"{len(found)} of {arguments.kills}", file=sys.stderr, flush=True)
            if "why" in one:
                print(one["index"], one["kills"], one["why"], file=sys.stderr, flush=True)
    counts, phases, commands = {}, {}, {}
    apart, wrong = [], 0
    for one in found:
        counts[one["what"]] = counts.get(one["what"], 0) + 1
        for phase in one["kills"]:
            phases[phase] = phases.get(phase, 0) + 1
        if one["what"] != "through":
            continue
        for command in one["wrong"]:
            commands[command] = commands.get(command, 0) + 1
            print(one["index"], one["kills"], f"{command} of the whole run differs", file=sys.stderr, flush=True)
        points = [p for p in one["points"] if p["kind"] == "point"]
        keys = [key(p) for p in points]
        if sorted(keys) != sorted(whole.points) or one["exit"] not in (0, -signal.SIGKILL):
            wrong += 1
            print(one["index"], one["kills"], f"exit {one['exit']}, {len(keys)} points, {len(set(keys))} places", file=sys.stderr, flush=True)
        for point in points:
            other = whole.points.get(key(point))
            if other and point["eta"] is not None and other["eta"] is not None:
                sigma = math.hypot(point["eta_high"] - point["eta_low"], other["eta_high"] - other["eta_low"]) / (2 * 1.96)
                apart.append(abs(point["eta"] - other["eta"]) / sigma)
    print(f"{sum(phases.values())} kills: " + ", ".join(f"{phase} {count}" for phase, count in sorted(phases.items())))
    print(", ".join(f"{what}: {count}" for what, count in sorted(counts.items())))
    print(f"steps and soaks that the journal promised and the recordings do not hold: {sum(one.get('lost', 0) for one in found)}")
    print(f"with a point missing or twice or another exit code: {wrong}")
    print("commands on the whole run that differ: " + (", ".join(f"{name} {count}" for name, count in commands.items()) or "none"))
    if apart:
        print(f"efficiency compared with the uninterrupted run, in standard errors of the difference: median {quantile(apart, 0.5):.2f}, "
              f"99 % {quantile(apart, 0.99):.2f}, worst {max(apart):.2f}")


if __name__ == "__main__":
    main()
