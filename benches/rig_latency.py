"""How fast a rig behind a PLC is made safe, seen at the PLC's own door: a relay in front of the server stamps what passes.

    python3 benches/rig_latency.py --bin target/release [--runs 10] [--python target/python-env/bin/python] [--security basic256_sha256]

Needs mapper, its drivers and mapper-lab-server built in --bin, and the packages of tests/python/requirements.txt for asyncua and pymodbus. For each
server, ms: from the answer that carries a speed above the guard's limit, to the first command of the way into the safe state; then, on the lab
server, s: from kill -9 of the runner to that command, and from the return of a server that was killed to its first answered read.

With --security basic256_sha256 OPC UA alone, signed and encrypted: a relay cannot read it, so the servers stamp inside, before they encrypt the answer and after they have decrypted
the command. Their own cryptography (asyncua's in Python) is part of the figure then. `none (inside)`: in the clear, from the same place, for comparison.
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
# The word by which a server marks a written set-point.
COMMANDED = "told"
# What makes four points of the shipped campaign, with a guard that its first point trips.
PARTS = [
    ("speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "speeds: [80 krpm, 125 krpm]"),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]"),
    ("warm_up: 2 min ", "warm_up: 60 s "),
    ("seed: 1 ", "repeats: off\nreturn_to_first: false\nseed: 1 "),
    ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ("method: joint ", "method: dynamic "),
]
GUARD = "guards: {overspeed: {above: 60 krpm, dwell: 0 s}}\n"


def campaign(driver, port, directory, guard, security):
    text = (ROOT / "campaigns/turbo_a.yaml").read_text()
    guide = (ROOT / "docs/how-to/rig.md").read_text().split(f"```yaml\nbackend:\n  {driver}:\n")[1].split("\n```")[0]
    guide = guide.replace(":5020 ", f":{port} ").replace(":4840", f":{port}")
    if driver == "opcua":
        lines = guide.replace("basic256_sha256 ", f"{security} ").splitlines()
        guide = "\n".join(line for line in lines if security != "none" or "{env:" not in line)
    for old, new in [*PARTS, ("  virtual_lab: {}", f"  {driver}:\n{guide}")]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = directory / f"{driver}-{port}.yaml"
    path.write_text(text + (GUARD if guard else ""))
    return path


class Relay:
    """Between a driver and its server; keeps (seconds, word, number)."""

    security = "none"

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
                    self.seen.append((now, COMMANDED, register))
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
                self.seen.append((now, COMMANDED, 0))
            elif not asked and kind == 634:
                at = frame.find(b"\x0b", 52)
                if at > 0 and len(frame) > 300:
                    self.seen.append((now, "read", struct.unpack("<d", frame[at + 1 : at + 9])[0]))
        return data


class Inside:
    """A server with stamps of its own, which `seen` has as a relay's."""

    def __init__(self, arguments, security, environment=None):
        self.security, self.seen = security, []
        self.process = subprocess.Popen(list(map(str, arguments)), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        self.port = int(self.process.stdout.readline().strip().rsplit(":", 1)[-1])
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.process.stdout:
            words = line.split()
            if len(words) == 3 and words[1] in ("read", COMMANDED):
                at, word, what = words
                self.seen.append((float(at), word, float(what) if word == "read" else what))

    def end(self):
        self.process.kill()
        self.process.wait()


def asyncua(bins, python, directory, security, port=0):
    secure = [] if security == "none" else ["--secure", directory / "server"]
    return Inside([python, ROOT / "tests/python/opcua_rig.py", port, "--stamps", *secure], security)


def stamped_lab(bins, python, directory, security, port=0):
    """Another stand each time, at rest."""
    arguments = [bins / "mapper-lab-server", ROOT / "campaigns/turbo_a.yaml", "--opcua", f"127.0.0.1:{port}", "--stamps"]
    arguments += ["--clear"] if security == "none" else []
    environment = {**os.environ, "MAPPER_STATE_DIR": str(directory / "lab"), "PLC_USER": "lab", "PLC_PASSWORD": "hunter2"}
    return Inside(arguments, security, environment)


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


def run(bins, driver, watch, directory, guard):
    """A run whose driver talks to what `watch` watches."""
    file = campaign(driver, watch.port, directory, guard, watch.security)
    state = directory / f"state-{time.monotonic_ns()}"
    environment = {**os.environ, "MAPPER_STATE_DIR": str(state), "PLC_USER": "lab", "PLC_PASSWORD": "hunter2"}
    if watch.security != "none":
        trust = [str(bins / "mapper-backend-opcua"), "trust", f"opc.tcp://127.0.0.1:{watch.port}"]
        subprocess.run(trust, check=True, stdout=subprocess.DEVNULL, env=environment)
    return subprocess.Popen([str(bins / "mapper"), "run", str(file), "--out", str(state / "runs")], stdout=subprocess.DEVNULL,
                            stderr=subprocess.PIPE, text=True, env=environment)


def wait(relay, holds, what, within_s=90.0):
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        if found := holds(list(relay.seen)):
            return found
        time.sleep(0.05)
    sys.exit(f"not seen: {what}; last: {relay.seen[-5:]}")


def first(seen, word, after=0.0, holds=lambda _: True):
    return next((at for at, kind, number in seen if kind == word and at > after and holds(number)), None)


def violation(bins, directory, driver, watch):
    process = run(bins, driver, watch, directory, True)
    try:
        above = wait(watch, lambda seen: first(seen, "read", holds=lambda rpm: rpm > LIMIT_RPM), "the violation")
        commanded = wait(watch, lambda seen: first(seen, COMMANDED, above), "the command")
    finally:
        process.wait()
    return 1e3 * (commanded - above)


def killed(bins, directory, driver, watch):
    process = run(bins, driver, watch, directory, False)
    wait(watch, lambda seen: first(seen, "read", holds=lambda rpm: rpm > 30e3), "a shaft that turns")
    at = time.monotonic()
    process.send_signal(signal.SIGKILL)
    process.wait()
    commanded = wait(watch, lambda seen: first(seen, COMMANDED, at), "the command")
    silent(watch)
    return commanded - at


def silent(watch):
    wait(watch, lambda seen: seen and time.monotonic() - seen[-1][0] > 1.0, "the end of the driver")


def restarted(bins, directory, driver, watch, kill, start):
    """`start` gives what watches the server then."""
    process = run(bins, driver, watch, directory, False)
    wait(watch, lambda seen: first(seen, "read", holds=lambda rpm: rpm > 30e3), "a shaft that turns")
    kill()
    time.sleep(0.5)
    watch = start()
    at = time.monotonic()
    back = wait(watch, lambda seen: first(seen, "read", at), "a read")
    process.send_signal(signal.SIGKILL)
    process.wait()
    silent(watch)
    return back - at


def row(name, values, unit):
    print(f"| {name} | {statistics.median(values):.1f} | {max(values):.1f} | {unit} | {len(values)} |", flush=True)


def in_the_clear(bins, python, directory, runs):
    fewer = max(1, runs // 2)
    for driver, other in [("modbus", "pymodbus"), ("opcua", "asyncua")]:
        server, port = third_party(python, driver)
        values = [violation(bins, directory, driver, Relay(driver, port)) for _ in range(runs)]
        row(f"violation to command, {driver}, {other}", values, "ms")
        server.kill()
        values = []
        for _ in range(runs):
            # Another stand each time, at rest.
            server, port = lab(bins, directory, driver)
            values.append(violation(bins, directory, driver, Relay(driver, port)))
            server.kill()
        row(f"violation to command, {driver}, lab server", values, "ms")
        values = []
        for _ in range(fewer):
            server, port = lab(bins, directory, driver)
            values.append(killed(bins, directory, driver, Relay(driver, port)))
            server.kill()
        row(f"kill -9 of the runner to command, {driver}, lab server", values, "s")
        values = []
        for _ in range(fewer):
            servers = [lab(bins, directory, driver)]
            port = servers[0][1]
            relay = Relay(driver, port)

            def kill():
                servers[0][0].kill()
                servers[0][0].wait()

            def start():
                servers.append(lab(bins, directory, driver, port))
                return relay

            values.append(restarted(bins, directory, driver, relay, kill, start))
            servers[1][0].kill()
        row(f"server back to samples, {driver}, lab server", values, "s")


def inside(bins, python, directory, runs, security):
    """OPC UA by the stamps of the servers themselves, each with another one each time."""
    fewer = max(1, runs // 2)
    for start, server in [(asyncua, "asyncua"), (stamped_lab, "lab server")]:

        def each(measure, protection, count):
            values = []
            for _ in range(count):
                one = start(bins, python, directory, protection)
                values.append(measure(one))
                one.end()
            return values

        for protection in ["none", security]:
            name = f"opcua, {server}, {protection} (inside)"
            row(f"violation to command, {name}", each(lambda one: violation(bins, directory, "opcua", one), protection, runs), "ms")
        row(f"kill -9 of the runner to command, {name}", each(lambda one: killed(bins, directory, "opcua", one), security, fewer), "s")
        values = []
        for _ in range(fewer):
            servers = [start(bins, python, directory, security)]

            def again():
                servers.append(start(bins, python, directory, security, servers[0].port))
                return servers[1]

            values.append(restarted(bins, directory, "opcua", servers[0], servers[0].end, again))
            servers[1].end()
        row(f"server back to samples, {name}", values, "s")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--security", choices=["none", "basic256_sha256"], default="none")
    arguments = parser.parse_args()
    print("| | median | largest | | runs |\n|---|---:|---:|---|---:|")
    with tempfile.TemporaryDirectory() as scratch:
        common = (arguments.bin.resolve(), arguments.python, pathlib.Path(scratch), arguments.runs)
        if arguments.security == "none":
            in_the_clear(*common)
        else:
            inside(*common, arguments.security)


main()
