"""The Python package: what it adds to the Rust call, and whether memory grows over a thousand calls.

    python benches/python_package.py [CALLS]

An hour of the virtual lab at 10 Hz, 14 channels, as a DataFrame to points: processor time of the whole, of the two calls of Rust in it
(import, with the checks of a log, and identification), and of the rest; medians of 30. Then CALLS (1000) calls each of
`Recording.from_frame`, `identify`, `Campaign.from_text` and `Map.to` on four minutes of it, with the resident memory after every tenth.
"""

import statistics
import sys
import tempfile
import time
from pathlib import Path

import mapper
from mapper import _mapper, _recording, _result

ROOT = Path(__file__).parents[1]
CHANNELS = ["N", "m_c", "P1", "T1", "P2", "T2", "Tc", "m_t", "P3", "T3", "P4", "T4", "Tt", "T_oil"]


def resident_mb():
    """Resident memory of this process, MB."""
    fields = Path("/proc/self/statm").read_text().split()
    return int(fields[1]) * 4096 / 1e6


def timed(work):
    """The result of a call and its processor time, s."""
    begun = time.process_time()
    result = work()
    return result, time.process_time() - begun


class Stopwatch:
    """The private module, with the time in its readers and its identification."""

    def __init__(self):
        self.spent_s = 0.0

    def __getattr__(self, name):
        return getattr(_mapper, name)

    @property
    def Recording(self):
        return self

    def of_frame(self, *arguments):
        return self.watch(_mapper.Recording.of_frame, *arguments)

    def identify(self, *arguments):
        return self.watch(_mapper.identify, *arguments)

    def watch(self, work, *arguments):
        result, took = timed(lambda: work(*arguments))
        self.spent_s += took
        return result


def main():
    calls = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    text = (ROOT / "campaigns/grid18.yaml").read_text()
    # 18 steps of 190 s and a warm-up of 3 min are an hour.
    hour = text.replace("warm_up: 60 min", "warm_up: 3 min").replace("dwell: 120 s", "dwell: 190 s")
    campaign = mapper.Campaign.from_text(hour)
    with tempfile.TemporaryDirectory() as directory:
        run = campaign.run(directory)
        frame = run.recording.frame[CHANNELS]
        compressor_map = run.map
        units = {symbol: unit for symbol, unit in run.recording.channels.items() if symbol in CHANNELS}
    mapping = {symbol: f"{symbol} [{unit}]" for symbol, unit in units.items()}

    def to_points():
        recording = mapper.Recording.from_frame(frame, mapping)
        result = mapper.identify(recording, campaign)
        # Recording and result live on, as in a notebook: the library frees them later.
        return recording, result, result.points

    rows = []
    for _ in range(30):
        watch = Stopwatch()
        _recording._mapper = _result._mapper = watch
        kept, whole = timed(to_points)
        rows.append((whole, watch.spent_s))
        del kept
    _recording._mapper = _result._mapper = _mapper
    whole, rust = (statistics.median(column) for column in zip(*rows))
    overhead = statistics.median(whole / rust - 1.0 for whole, rust in rows)
    print(f"{len(frame)} rows x {len(CHANNELS)} channels: {whole:.3f} s to points, {rust:.3f} s of them in Rust; overhead {100 * overhead:.1f} %")

    short = frame.iloc[-2400:]

    def call():
        recording = mapper.Recording.from_frame(short, mapping)
        assert len(mapper.identify(recording, campaign, method="dynamic").points) >= 1
        assert mapper.Campaign.from_text(campaign.text).name == campaign.name
        assert compressor_map.to("csv")

    call()
    resident = [resident_mb()]
    for _ in range(10):
        for _ in range(calls // 10):
            call()
        resident.append(resident_mb())
    print(f"resident memory over {calls} calls, MB:", ", ".join(f"{mb:.1f}" for mb in resident))


main()
