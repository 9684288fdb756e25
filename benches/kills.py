"""What is left of a run that is killed at any moment, and whether the rest of it makes the same map.

    cargo build --release
    target/python-env/bin/python benches/kills.py --mapper target/release/mapper --kills 200

Runs `campaigns/turbo_a.yaml` with its points in the order in which they are listed (planning would take most of the time that kills are
drawn from), kills it with SIGKILL at a random moment, goes on with `mapper run --resume` until it is through,
and compares with the uninterrupted run: steps whose journal entry holds but whose samples are not in the recording, points
that are there twice or not at all, and how far efficiencies lie apart, in their own standard errors. A resumed run warms up again and
draws other noise: differences of about one standard error are noise.
"""

import argparse
import concurrent.futures
import json
import math
import os
import random
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
    """Steps that the journal calls saved and whose end the recording, cut as it is, does not hold."""
    journal = run / "journal.jsonl"
    lines = journal.read_text(errors="replace").split("\n")[:-1] if journal.exists() else []
    promised = {entry["step_saved"] for entry in map(json.loads, lines) if isinstance(entry, dict) and "step_saved" in entry}
    ended, topics = set(), {}
    try:
        with open(run / "recording.mcap", "rb") as file:
            for record in StreamReader(file, record_size_limit=None).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and topics.get(record.channel_id) == "/step":
                    step = json.loads(record.data)
                    if step["phase"] == "end":
                        ended.add(step["step"])
    except Exception as error:  # The cut end of the file: what came before it was read.
        print(f"the recording ends with: {error}", file=sys.stderr) if not topics else None
    return len(promised - ended)


def killed(mapper, folder, index, campaign, whole_bytes, until):
    """One run, killed once, resumed; what is wrong with it."""
    if time.monotonic() > until:
        return {"index": index, "what": "not tried"}
    rng = random.Random(index)
    out = folder / f"run-{index}"
    environment = {**os.environ, "MAPPER_STATE_DIR": str(folder / f"state-{index}")}
    # A share of the recording, and up to 30 ms more: a busy machine makes runs longer, and their bytes no more.
    at_bytes, more_s = rng.uniform(0.0, 1.0) * whole_bytes, rng.uniform(0.0, 0.03)
    process = subprocess.Popen(
        [mapper, "run", str(campaign), "--out", str(out)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment
    )
    while process.poll() is None:
        found = list(out.glob("*/recording.mcap"))
        if found and found[0].stat().st_size >= at_bytes:
            break
        time.sleep(0.002)
    time.sleep(more_s)
    if process.poll() is not None:
        return {"index": index, "what": "through"}
    process.send_signal(signal.SIGKILL)
    process.wait()
    runs = list(out.glob("*/recording.mcap"))
    if not runs:
        return {"index": index, "what": "before the first sample"}
    run = runs[0].parent
    if (run / "points.json").exists():
        return {"index": index, "what": "after the last sample"}
    lost = promised_and_lost(run)
    done = subprocess.run([mapper, "run", "--resume", str(run)], capture_output=True, text=True, env=environment)
    if not (run / "points.json").exists():
        return {"index": index, "what": "not resumed", "why": f"exit {done.returncode}: {done.stderr.strip()[-400:]}"}
    return {"index": index, "what": "resumed", "points": points_of(run), "exit": done.returncode, "lost": lost}


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
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    mapper = str(Path(arguments.mapper).resolve())
    found = []
    until = time.monotonic() + 60 * arguments.minutes
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        folder = Path(scratch)
        campaign = listed(folder, arguments.short)
        subprocess.run([mapper, "run", str(campaign), "--out", str(folder / "whole")], check=True, capture_output=True)
        whole_bytes = next((folder / "whole").glob("*/recording.mcap")).stat().st_size
        whole = {key(p): p for p in points_of(next((folder / "whole").iterdir())) if p["kind"] == "point"}
        seeds = range(arguments.first, arguments.first + arguments.kills)
        for one in pool.map(lambda index: killed(mapper, folder, index, campaign, whole_bytes, until), seeds):
            found.append(one)
            if len(found) % 20 == 0:
                print(f"{len(found)} of {arguments.kills}", file=sys.stderr, flush=True)
            if "why" in one:
                print(one["index"], one["why"], file=sys.stderr, flush=True)
    counts = {}
    apart, wrong = [], 0
    for one in found:
        counts[one["what"]] = counts.get(one["what"], 0) + 1
        if one["what"] != "resumed":
            continue
        points = [p for p in one["points"] if p["kind"] == "point"]
        keys = [key(p) for p in points]
        if sorted(keys) != sorted(whole) or one["exit"] != 0:
            wrong += 1
            print(one["index"], f"exit {one['exit']}, {len(keys)} points, {len(set(keys))} places", file=sys.stderr, flush=True)
        for point in points:
            other = whole.get(key(point))
            if other and point["eta"] is not None and other["eta"] is not None:
                sigma = math.hypot(point["eta_high"] - point["eta_low"], other["eta_high"] - other["eta_low"]) / (2 * 1.96)
                apart.append(abs(point["eta"] - other["eta"]) / sigma)
    print(", ".join(f"{what}: {count}" for what, count in sorted(counts.items())))
    print(f"steps that the journal promised and the recording does not hold: {sum(one.get('lost', 0) for one in found)}")
    print(f"of the resumed, with a point missing or twice or another exit code: {wrong}")
    if apart:
        print(f"efficiency compared with the uninterrupted run, in standard errors of the difference: median {quantile(apart, 0.5):.2f}, "
              f"99 % {quantile(apart, 0.99):.2f}, worst {max(apart):.2f}")


if __name__ == "__main__":
    main()
