"""What is left of a run that is killed at any moment, up to three times, and whether the rest of it makes the same map.

    cargo build --release --locked
    target/python-env/bin/python benches/kills.py --mapper target/release/mapper --kills 500

Runs four campaigns in turn: nine points of a minute evaluated by `dynamic` and by `joint` with a repeated jump, the same with a search of
the surge line, and the same as a script that waits at each point. A resumed run draws other noise, which hides what the kill changes: each
campaign is also run with a twentieth of the declared noise, compared in standard errors of a run with the declared noise. Kills each run with SIGKILL at a random moment of a random phase: start
(planning, connecting), recording (soak, warm-up, steps), end (identification, writing of results). Then it goes on with `mapper run
--resume`, which is killed in the same way up to twice more, until it is through, and compares with the uninterrupted run:

- steps and soaks whose journal entry holds but which the recordings, cut as they are, do not contain;
- points that are there twice or not at all, and the exit code;
- efficiencies of points and map, in standard errors of the uninterrupted run;
- whether `identify RUN` gives the points of `RUN/points.json`, `report RUN` its page, and `drift RUN` the answer of the uninterrupted run.
"""

import argparse
import collections
import concurrent.futures
import csv
import itertools
import json
import math
import os
import random
import re
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
    """The uninterrupted run of one campaign."""

    def __init__(self, mapper, kind, campaign, folder, declared=None):
        begin = time.monotonic()
        self.kind, self.campaign = kind, campaign
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
        self.map = map_of(self.run)
        # Standard errors of points and map are those with the declared noise.
        self.declared = declared or self
        self.drift = drift_of(mapper, self.run)


def answer(mapper, command, run):
    done = subprocess.run([mapper, command, str(run), "--json"], capture_output=True, text=True)
    return done.returncode, done.stdout


def drift_of(mapper, run):
    """Exit code and verdict."""
    code, text = answer(mapper, "drift", run)
    return code, json.loads(text).get("verdict") if code == 0 else None


def map_of(run):
    """Efficiency and its 95 % interval at each place of the map."""
    rows = csv.DictReader(line for line in (run / "map.csv").read_text().splitlines() if not line.startswith("#"))
    places = {}
    for row in rows:
        # Repeats of a place count up; the measured speed is within 0.1 krpm of the target.
        place = (round(float(row["speed_rpm"]), -3), float(row["valve"]))
        places.setdefault(place, []).append({name: float(row[name]) for name in ("eta", "eta_low", "eta_high") if row[name]})
    return {(*place, number): cells for place, found in places.items() for number, cells in enumerate(found)}


def difference(one, other, declared):
    """Of two efficiencies, in standard errors."""
    return abs(one["eta"] - other["eta"]) / ((declared["eta_high"] - declared["eta_low"]) / (2 * 1.96))


def kill(process, rng, whole, recordings, done_bytes, progress):
    """Kills the process at a random moment of a random phase; returns whether it was still there."""
    phase = rng.choice(["start", "recording", "recording", "end"])
    begin = time.monotonic()
    before = set(recordings())
    at_bytes, more_s = rng.uniform(0.0, 1.0) * max(whole.bytes - done_bytes, 0.1 * whole.bytes), rng.uniform(0.0, 0.03)
    if phase == "start":
        time.sleep(rng.uniform(0.0, 1.0) * whole.start_s)
    while phase != "start" and process.poll() is None and time.monotonic() - begin < 600:
        new = [path for path in recordings() if path not in before]
        reached = new and new[0].stat().st_size >= at_bytes if phase == "recording" else b'"rig_released"' in progress.read_bytes()
        if reached:
            break
        time.sleep(0.002)
    time.sleep(more_s if phase != "end" else rng.uniform(0.0, 1.2) * whole.end_s)
    if process.poll() is not None:
        return False
    process.send_signal(signal.SIGKILL)
    process.wait()
    return True


def phase_of(run, progress):
    """Where the kill came, by what is on the disk and what was reported."""
    reported = progress.read_text(errors="replace")
    if '"rig_released"' in reported:
        return "identification, report"
    if run is None or '"reported"' not in reported:
        return "planning, connecting"
    kinds = [json.loads(line)["kind"] for line in reported.splitlines() if line.startswith("{") and line.endswith("}") and '"event":"reported"' in line]
    if "soak_started" in kinds and "soak_ended" not in kinds:
        return "soak"
    started, ended = reported.count('"step_started"'), reported.count('"step_ended"')
    if started > ended:
        return "step"
    return "warm-up" if started == 0 else "between steps"


def killed(mapper, folder, index, whole, again):
    """One run, killed and resumed; what is wrong with it."""
    rng = random.Random(index)
    out = folder / f"run-{index}"
    environment = {**os.environ, "MAPPER_STATE_DIR": str(folder / f"state-{index}")}
    recordings = lambda: sorted(out.glob("*/recording*.mcap"))
    progress = folder / f"progress-{index}"

    def start(arguments):
        with progress.open("w") as file:
            return subprocess.Popen([mapper, "run", *arguments, "--progress", "json"], stdout=subprocess.DEVNULL, stderr=file, env=environment)

    kills, lost = [], 0
    process = start([str(whole.campaign), "--out", str(out)])
    for _ in range(1 + again):
        if not kill(process, rng, whole, recordings, sum(path.stat().st_size for path in recordings()), progress):
            break
        runs = [path.parent for path in recordings()]
        kills.append(phase_of(runs[0] if runs else None, progress))
        if runs and not (runs[0] / "report.html").exists():
            lost += promised_and_lost(runs[0])
            process = start(["--resume", str(runs[0])])
        elif runs:
            break
        else:
            process = start([str(whole.campaign), "--out", str(out)])
    process.wait()
    found = {"index": index, "kind": whole.kind, "kills": kills, "lost": lost}
    runs = [path.parent for path in recordings()]
    if not runs or not (runs[0] / "report.html").exists():
        return {**found, "why": f"exit {process.returncode}: {progress.read_text(errors='replace').strip()[-400:]}"}
    run = runs[0]
    points = points_of(run)
    code, text = answer(mapper, "identify", run)
    same = code == 0 and [(key(p), p["eta"]) for p in json.loads(text)["points"]] == [(key(p), p["eta"]) for p in points]
    page = subprocess.run([mapper, "report", str(run), "--out", str(out / "page.html")], capture_output=True, env=environment)
    shown = page.returncode == 0 and (out / "page.html").exists()
    drift = drift_of(mapper, run) == whole.drift
    wrong = [name for name, right in [("identify", same), ("report", shown), ("drift", drift)] if not right]
    apart = map_of(run)
    shutil.rmtree(out)
    return {**found, "points": points, "map": apart, "exit": process.returncode, "wrong": wrong, "whole": whole}


def campaigns(folder):
    """Campaigns without a search for the order of their points."""
    shipped = (ROOT / "campaigns" / "turbo_a.yaml").read_text()
    short = [
        ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [80 krpm, 110 krpm, 140 krpm]"),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.0, 1.4]"),
        ("soak: 30 min", "soak: 5 min"),
        ("  dwell: 40 s ", "  dwell: 60 s "),
        ("  formats: [csv, json, svg]\n", "  formats: [csv]\n"),
    ]
    listed, seed = ("order: thermal_gradient ", "order: listed "), "seed: 1 "
    repeats = "repeats: {jump: {from: {speed: 80 krpm, opening: 1.0}, to: {speed: 140 krpm, opening: 1.0}}, every: 4, at_least: 3}\n"
    (folder / "waits.rhai").write_text('for p in grid() { settle(p, "3 min", "0.05 K/s"); }\n')
    kinds = {
        "dynamic": [listed, ("method: joint ", "method: dynamic ")],
        "joint": [listed, (seed, repeats + seed)],
        "surge": [listed, (seed, f"surge_search: {{dwell: 12 s}}\n{seed}")],
        "script": [listed, (seed, f"sequence: waits.rhai\n{seed}")],
    }
    for kind, changes in kinds.items():
        text = shipped
        for before, after in short + changes:
            assert before in text, before
            text = text.replace(before, after)
        quiet = re.sub(r"noise: ([0-9.e-]+)", lambda found: f"noise: {float(found[1]) / 20:g}", text)
        for name, content in ((kind, text), (f"{kind}, noise / 20", quiet)):
            path = folder / f"{name.replace(', noise / ', '-')}.yaml"
            path.write_text(content)
            yield name, path


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mapper", default="target/release/mapper")
    parser.add_argument("--kills", type=int, default=200, help="begins no further run after so many")
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--minutes", type=float, default=math.inf, help="begins no further run after so long")
    parser.add_argument("--again", type=int, default=2, help="further kills of a resumed run")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    mapper = str(Path(arguments.mapper).resolve())
    found, kills = [], 0
    until = time.monotonic() + 60 * arguments.minutes
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        folder = Path(scratch)
        wholes = []
        for kind, path in campaigns(folder):
            wholes.append(Whole(mapper, kind, path, folder / f"whole-{path.stem}", wholes[-1] if "noise" in kind else None))
        seeds = itertools.count(arguments.first)
        one_more = lambda index: pool.submit(killed, mapper, folder, index, wholes[index % len(wholes)], arguments.again)
        running = {one_more(next(seeds)) for _ in range(arguments.jobs)}
        while running:
            done, running = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
            for one in (future.result() for future in done):
                found.append(one)
                kills += len(one["kills"])
                if "why" in one:
                    print(one["index"], one["kind"], one["kills"], one["why"], file=sys.stderr, flush=True)
            if kills < arguments.kills and time.monotonic() < until:
                running |= {one_more(next(seeds)) for _ in done}
    table(found)


def table(found):
    print("| campaign | runs | kills | not resumed | promised and lost | points missing or twice, or another exit | identify, report, drift differ | points: median, 99 %, worst | map: worst |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|")
    for kind in sorted({one["kind"] for one in found}):
        ones = [one for one in found if one["kind"] == kind]
        points, maps, wrong, differ = [], [], 0, 0
        for one in (one for one in ones if "points" in one):
            differ += bool(one["wrong"])
            whole = one["whole"]
            own = {key(p): p for p in one["points"] if p["kind"] == "point"}
            count = sum(p["kind"] == "point" for p in one["points"])
            if one["wrong"] or own.keys() != whole.points.keys() or count != len(own) or one["exit"] not in (0, -signal.SIGKILL):
                wrong += own.keys() != whole.points.keys() or count != len(own) or one["exit"] not in (0, -signal.SIGKILL)
                print(one["index"], kind, one["kills"], f"exit {one['exit']}, {count} points at {len(own)} places; differ:", one["wrong"], file=sys.stderr)
            places = own.keys() & whole.points.keys() & whole.declared.points.keys()
            both = [(own[place], whole.points[place], whole.declared.points[place]) for place in places]
            points += [difference(*three) for three in both if all(p["eta"] is not None for p in three)]
            places = one["map"].keys() & whole.map.keys() & whole.declared.map.keys()
            cells = [(one["map"][place], whole.map[place], whole.declared.map[place]) for place in places]
            maps += [difference(*three) for three in cells if all(len(cell) == 3 for cell in three)]
        numbers = [len(ones), sum(len(one["kills"]) for one in ones), sum("why" in one for one in ones), sum(one["lost"] for one in ones), wrong, differ]
        apart = ", ".join(f"{quantile(points, share):.2f}" for share in (0.5, 0.99, 1.0)) if points else "-"
        print(f"| {kind} | " + " | ".join(map(str, numbers)) + f" | {apart} | {max(maps, default=math.nan):.2f} |")
    phases = collections.Counter(phase for one in found for phase in one["kills"])
    print(f"\n{sum(phases.values())} kills: " + ", ".join(f"{phase} {count}" for phase, count in phases.most_common()))


if __name__ == "__main__":
    main()
