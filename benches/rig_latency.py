"""How fast a rig behind a PLC is made safe, seen at the PLC's own door: a relay in front of the server stamps what passes.

    python3 benches/rig_latency.py --bin target/release [--runs 10] [--python target/python-env/bin/python]

Needs mapper, its drivers and mapper-lab-server built in --bin, and the packages of tests/python/requirements.txt for asyncua and pymodbus. For each
server, ms: from the answer that carries a speed above the guard's limit, to the first command of the way into the safe state; then, on the lab
server, s: from kill -9 of the runner to that command, and from the return of a server that was killed to its first answered read.
"""

import argparse
import os
import pathlib
import select
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
LIMIT_RPM = 60e3
# What makes four points of the shipped campaign, with a guard that its first point trips.
PARTS = [
    ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [80 krpm, 125 krpm]"),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]"),
    ("warm_up: 2 min ", "warm_up: 60 s "),
    ("required_sigma_eta: 0.5 %\n", ""),
    ("seed: 1 ", "repeats: off\nreturn_to_first: false\nseed: 1 "),
    ("zero: {soak: 30 min, evenness: 0.01 K, pressure_evenness: 1 Pa}\n", ""),
    ("method: joint ", "method: dynamic "),
]
GUARD = "guards: {overspeed: {above: 60 krpm, dwell: 0 s}}\n"


def campaign(driver, port, directory, guard, security="none"):
    text = (ROOT / "campaigns/turbo_a.yaml").read_text()
    guide = (ROOT / "docs/rig.md").read_text().split(f"```yaml\nbackend:\n  {driver}:\n")[1].split("\n```")[0]
    guide = guide.replace(":5020 ", f":{port} ").replace(":4840", f":{port}")
    if driver == "opcua":
        lines = guide.replace("basic256_sha256 ", f"{security} ").splitlines()
        guide = "\n".join(line for line in lines if "{env:" not in line)
    for old, new in [*PARTS, ("  virtual_lab: {}", f"  {driver}:\n{guide}")]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = directory / f"{driver}-{port}.yaml"
    path.write_text(text + (GUARD if guard else ""))
    return path


class Relay:
    """Between a driver and its server; keeps (seconds, word, number)."""

    def __init__(self, driver, target):
        self.parse = self.modbus if driver == "modbus" else self.opcua
        self.target, self.seen = target, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.listener.accept()
            threading.Thread(target=self.carry, args=(client,), daemon=True).start()

    def carry(self, client):
        try:
            server = socket.create_connection(("127.0.0.1", self.target), timeout=1)
        except OSError:
            client.close()
            return
        for one in (client, server):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        rest = {client: b"", server: b""}
        try:
            while True:
                for one in select.select([client, server], [], [])[0]:
                    data = one.recv(65536)
                    if not data:
                        return
                    now = time.monotonic()
                    (server if one is client else client).sendall(data)
                    rest[one] = self.parse(now, rest[one] + data, one is client)
        except OSError:
            pass
        finally:
            client.close()
            server.close()

    def modbus(self, now, data, asked):
        while len(data) >= 8 and len(data) >= 6 + struct.unpack(">H", data[4:6])[0]:
            size = 6 + struct.unpack(">H", data[4:6])[0]
            frame, data = data[:size], data[size:]
            function = frame[7]
            if asked and function in (6, 16):
                register = struct.unpack(">H", frame[8:10])[0]
                if register != 111:
                    self.seen.append((now, "told", register))
            elif not asked and function == 3 and len(frame) > 40:
                self.seen.append((now, "read", struct.unpack(">f", frame[9:13])[0]))
        return data

    def opcua(self, now, data, asked):
        while len(data) >= 8 and len(data) >= struct.unpack("<I", data[4:8])[0]:
            size = struct.unpack("<I", data[4:8])[0]
            frame, data = data[:size], data[size:]
            if frame[:3] != b"MSG":
                continue
            kind = struct.unpack("<H", frame[26:28])[0]
            if asked and kind == 673 and b"\x09\x00\x00\x00heartbeat" not in frame:
                self.seen.append((now, "told", 0))
            elif not asked and kind == 634:
                at = frame.find(b"\x0b", 52)
                if at > 0 and len(frame) > 300:
                    self.seen.append((now, "read", struct.unpack("<d", frame[at + 1 : at + 9])[0]))
        return data


def lab(bins, directory, driver, port=0):
    arguments = [bins / "mapper-lab-server", ROOT / "campaigns/turbo_a.yaml", f"--{driver}", f"127.0.0.1:{port}"]
    arguments += ["--clear"] if driver == "opcua" else []
    environment = {**os.environ, "MAPPER_STATE_DIR": str(directory / "lab")}
    process = subprocess.Popen(list(map(str, arguments)), stdout=subprocess.PIPE, text=True, env=environment)
    return process, int(process.stdout.readline().strip().rsplit(":", 1)[1])


def third_party(python, driver):
    script = ROOT / "tests/python" / f"{driver}_rig.py"
    process = subprocess.Popen([python, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    return process, int(process.stdout.readline())


def run(bins, file, directory):
    state = directory / f"state-{time.monotonic_ns()}"
    return subprocess.Popen([str(bins / "mapper"), "run", str(file), "--out", str(state / "runs")], stdout=subprocess.DEVNULL,
                            stderr=subprocess.PIPE, text=True, env={**os.environ, "MAPPER_STATE_DIR": str(state)})


def wait(relay, holds, what, within_s=90.0):
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        if found := holds(list(relay.seen)):
            return found
        time.sleep(0.05)
    sys.exit(f"not seen: {what}; last: {relay.seen[-5:]}")


def first(seen, word, after=0.0, holds=lambda _: True):
    return next((at for at, kind, number in seen if kind == word and at > after and holds(number)), None)


def violation(bins, directory, driver, port):
    relay = Relay(driver, port)
    process = run(bins, campaign(driver, relay.port, directory, True), directory)
    try:
        above = wait(relay, lambda seen: first(seen, "read", holds=lambda rpm: rpm > LIMIT_RPM), "the violation")
        told = wait(relay, lambda seen: first(seen, "told", above), "the command")
    finally:
        process.wait()
    return 1e3 * (told - above)


def killed(bins, directory, driver, port):
    relay = Relay(driver, port)
    process = run(bins, campaign(driver, relay.port, directory, False), directory)
    wait(relay, lambda seen: first(seen, "read", holds=lambda rpm: rpm > 30e3), "a shaft that turns")
    at = time.monotonic()
    process.send_signal(signal.SIGKILL)
    process.wait()
    told = wait(relay, lambda seen: first(seen, "told", at), "the command")
    wait(relay, lambda seen: seen and time.monotonic() - seen[-1][0] > 1.0, "the end of the driver")
    return told - at


def restarted(bins, directory, driver, server, port):
    relay = Relay(driver, port)
    process = run(bins, campaign(driver, relay.port, directory, False), directory)
    wait(relay, lambda seen: first(seen, "read", holds=lambda rpm: rpm > 30e3), "a shaft that turns")
    server.kill()
    server.wait()
    time.sleep(0.5)
    server, _ = lab(bins, directory, driver, port)
    at = time.monotonic()
    back = wait(relay, lambda seen: first(seen, "read", at), "a read")
    process.send_signal(signal.SIGKILL)
    process.wait()
    wait(relay, lambda seen: seen and time.monotonic() - seen[-1][0] > 1.0, "the end of the driver")
    return back - at, server


def row(name, values, unit):
    print(f"| {name} | {statistics.median(values):.1f} | {max(values):.1f} | {unit} | {len(values)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args()
    bins, runs = arguments.bin.resolve(), arguments.runs
    print("| | median | largest | | runs |\n|---|---:|---:|---|---:|")
    with tempfile.TemporaryDirectory() as scratch:
        directory = pathlib.Path(scratch)
        for driver, other in [("modbus", "pymodbus"), ("opcua", "asyncua")]:
            server, port = third_party(arguments.python, driver)
            values = [violation(bins, directory, driver, port) for _ in range(runs)]
            row(f"violation to command, {driver}, {other}", values, "ms")
            server.kill()
            values = []
            for _ in range(runs):
                # Another stand each time, at rest.
                server, port = lab(bins, directory, driver)
                values.append(violation(bins, directory, driver, port))
                server.kill()
            row(f"violation to command, {driver}, lab server", values, "ms")
            values = []
            for _ in range(max(1, runs // 2)):
                server, port = lab(bins, directory, driver)
                values.append(killed(bins, directory, driver, port))
                server.kill()
            row(f"kill -9 of the runner to command, {driver}, lab server", values, "s")
            values = []
            for _ in range(max(1, runs // 2)):
                server, port = lab(bins, directory, driver)
                value, server = restarted(bins, directory, driver, server, port)
                values.append(value)
                server.kill()
            row(f"server back to samples, {driver}, lab server", values, "s")


main()
