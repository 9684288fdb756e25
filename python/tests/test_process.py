"""Ctrl-C leaves the rig safe, events arrive, other threads go on, and memory does not grow."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mapper
import pytest

# Says when the rig runs; then takes hours of the rig's time.
SCRIPT = """
import signal
import sys
import mapper

# A program that is started in the background ignores SIGINT, and so would this one.
signal.signal(signal.SIGINT, signal.default_int_handler)

def show(event):
    if event["event"] == "step_started":
        print("running", flush=True)

campaign = mapper.Campaign.load(sys.argv[1])
try:
    campaign.run(sys.argv[2], progress=show)
except KeyboardInterrupt as interrupt:
    print("interrupted", *getattr(interrupt, "__notes__", []), flush=True)
    sys.exit(7)
"""


def test_ctrl_c_leaves_the_rig_safe_and_the_recording_readable(
    campaign_file: Path, tmp_path: Path, command: Callable[..., Any]
) -> None:
    long = tmp_path / "long.yaml"
    long.write_text(campaign_file.read_text().replace("dwell: 120 s", "dwell: 12 h"))
    runs = tmp_path / "runs"
    arguments = [sys.executable, "-c", SCRIPT, str(long), str(runs)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "running"
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
        assert process.wait(timeout=60) == 7
    assert rest.startswith("interrupted")
    directories = [path for path in runs.iterdir() if (path / "recording.mcap").is_file()]
    assert len(directories) == 1
    recording = mapper.Recording.read(directories[0])
    kinds = list(recording.events["kind"])
    assert kinds.index("interrupted") < kinds.index("safe_state")
    assert "latched" not in kinds
    assert recording.warnings == []
    assert command("identify", directories[0])["recording"] == str(directories[0] / "recording.mcap")


DIAGNOSIS = """
import signal
import sys
import mapper

signal.signal(signal.SIGINT, signal.default_int_handler)

campaign = mapper.Campaign.load(sys.argv[1])
recording = mapper.Recording.read(sys.argv[2])
try:
    print("running", flush=True)
    mapper.diagnose(recording, campaign)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(7)
"""


def test_ctrl_c_ends_a_diagnosis(run: mapper.Run, campaign_file: Path) -> None:
    arguments = [sys.executable, "-c", DIAGNOSIS, str(campaign_file), str(run.directory)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "running"
        process.send_signal(signal.SIGINT)
        assert process.stdout.read().strip() == "interrupted"
        assert process.wait(timeout=60) == 7


def test_an_error_of_the_observer_stops_the_run(campaign: mapper.Campaign, tmp_path: Path) -> None:
    def fail(event: dict[str, Any]) -> None:
        raise RuntimeError(event["event"])

    with pytest.raises(RuntimeError):
        campaign.run(tmp_path, progress=fail)


def test_events_have_the_rig_s_time(campaign: mapper.Campaign, tmp_path: Path) -> None:
    events: list[dict[str, Any]] = []
    run = campaign.run(tmp_path, progress=events.append)
    kinds = {event["event"] for event in events}
    assert {"run_started", "rig_time"} <= kinds
    assert run.end == "completed"


def test_other_threads_go_on_during_work(run: mapper.Run, campaign: mapper.Campaign) -> None:
    recording = run.recording
    longest, last, done = 0.0, time.perf_counter(), threading.Event()

    def watch() -> None:
        nonlocal longest, last
        while not done.is_set():
            now = time.perf_counter()
            longest, last = max(longest, now - last), now
            time.sleep(0.001)

    watcher = threading.Thread(target=watch)
    watcher.start()
    begun = time.perf_counter()
    mapper.identify(recording, campaign, method="joint")
    taken = time.perf_counter() - begun
    done.set()
    watcher.join()
    # A lock held throughout would stop the watcher for the whole time.
    assert longest < 0.5 * taken


def test_memory_does_not_grow(campaign: mapper.Campaign, run: mapper.Run) -> None:
    # 5 000 rows of 19 channels are 0.8 MB.
    samples = run.recording.frame.iloc[-5_000:]
    mapping = {symbol: f"{symbol} [{unit}]" for symbol, unit in run.recording.channels.items()}

    def work(calls: int) -> None:
        for _ in range(calls):
            recording = mapper.Recording.from_frame(samples, mapping)
            assert len(recording["T2"]) == len(samples)
            assert mapper.Campaign.from_text(campaign.text).name == campaign.name
            assert run.map.to("csv")

    work(20)
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    work(100)
    after_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # A recording that is kept at every call would take 80 MB. Allocators keep some of what was freed.
    assert after_kib - before_kib < 20_000
