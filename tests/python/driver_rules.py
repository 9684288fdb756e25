"""What plugins/drivers/python/mapper_driver.py does when the host is gone or the rig does not obey: time is an argument, no clock is read, except for a full real pipe.

Prints {"held": [...]}, the facts that held; fails with the first that does not.
"""

import io
import json
import os
import pathlib
import random
import socket
import struct
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "plugins/drivers/python"))
import mapper_driver  # noqa: E402
from mapper_driver import Refused, Server, description, read_frame  # noqa: E402

ACCEPTS = {"p3_pa": (50e3, 600e3), "t3_k": (350.0, 1100.0), "valve_opening_ratio": (0.05, 1.4), "oil_temperature_k": (250.0, 450.0)}
SETPOINTS = {"mode": "running", "p3_pa": 180e3, "t3_k": 800.0, "valve_opening_ratio": 0.7, "oil_temperature_k": 323.15}


class Stubborn(mapper_driver.Rig):
    """Writes down its commands; takes its safe state after so many tries, and refuses set-points from a pressure on."""

    def __init__(self, tries=1, simulated=False, accepts=ACCEPTS, lowest_p3=0.0):
        self.tries, self.simulated, self.accepts, self.lowest_p3 = tries, simulated, accepts, lowest_p3
        self.commands, self.asked, self.polled, self.disarmed = [], 0, 0, False

    def describe(self):
        # Opens its valve further than it accepts: the way down has to keep to what is accepted.
        safe = {"p3_slew_pa_s": 100e3, "valve_opening_ratio": 2.5, "within_s": 20.0}
        return description(["N", "P3"], 10.0, self.simulated, self.accepts, safe, [])

    def set(self, setpoints):
        if setpoints["p3_pa"] < self.lowest_p3:
            raise Refused("lost", "the controller does not take it", t_s=0.0)
        self.commands.append(dict(setpoints))

    def hold(self):
        self.commands.append("hold")

    def make_safe(self):
        self.asked += 1
        if self.asked < self.tries:
            raise RuntimeError("the valve does not answer")

    def disarm(self):
        self.disarmed = True

    def poll(self, until_s):
        self.polled += 1
        return [until_s], {"N": [1.0], "P3": [1.0]}, []


class Host:
    """Asks a server, with a clock of its own."""

    def __init__(self, rig):
        self.rig, self.now_s, self.id = rig, 0.0, 0
        self.server = Server("stubborn", "1", lambda _: rig)
        self.ask("hello", magic=mapper_driver.MAGIC, protocol=mapper_driver.VERSION)
        self.ask("configure", settings=None)
        self.ask("describe")
        self.ask("arm")
        self.server.tick(self.now_s)
        assert "result" in self.ask("set", **SETPOINTS)
        rig.commands.clear()

    def ask(self, method, **params):
        self.id += 1
        message = {"id": self.id, "method": method, "params": params, "session": self.server.session}
        self.server.take(self.now_s, message)
        answers = [one for one in self.server.out if one.get("id") == self.id]
        self.server.out = [one for one in self.server.out if "id" not in one]
        return answers[0]

    def run(self, for_s):
        """As serve() does: it wakes when something is due, and at each tenth."""
        end_s = self.now_s + for_s
        while self.now_s < end_s - 1e-9 and not self.server.over():
            within_s = self.server.tick(self.now_s)
            self.now_s += min(max(within_s or 0.1, 0.001), 0.1)

    def notes(self):
        return [one["params"]["message"] for one in self.server.out if one["method"] == "note"]


def the_way_down_keeps_to_what_the_rig_accepts():
    host = Host(Stubborn())
    host.run(4.0)
    way = host.rig.commands
    assert len(way) >= 7, way
    assert all(one["t3_k"] == 350.0 and one["valve_opening_ratio"] == 1.4 for one in way), way
    steps = [a["p3_pa"] - b["p3_pa"] for a, b in zip(way, way[1:])]
    assert all(0.0 < step < 25e3 for step in steps) and way[0]["p3_pa"] < 180e3, steps
    assert way[-1]["p3_pa"] > 105e3 and host.rig.asked == 1
    refused = host.ask("set", **SETPOINTS)
    assert refused["error"]["code"] == "lease_ended", refused


def the_lease_ends_after_two_seconds_and_not_before():
    host = Host(Stubborn())
    host.run(1.9)
    assert not host.rig.commands
    host.run(0.4)
    assert host.rig.commands, "2.5 s are promised from the last word to the first command"


def a_lease_that_is_renewed_goes_on():
    host = Host(Stubborn())
    for _ in range(20):
        host.run(0.5)
        host.server.take(host.now_s, {"method": "lease", "session": host.server.session})
    assert not host.rig.commands
    for _ in range(5):
        host.server.take(host.now_s, {"method": "lease", "session": "another"})
        host.run(0.5)
    assert host.rig.commands, "a word of another session renews nothing"


def words_that_come_meanwhile_do_not_hasten_the_way_down():
    host = Host(Stubborn())
    host.run(2.2)
    before = len(host.rig.commands)
    for _ in range(50):
        host.server.take(host.now_s, {"method": "lease", "session": host.server.session})
        host.server.tick(host.now_s)
    assert len(host.rig.commands) <= before + 1, host.rig.commands


def a_set_point_that_is_refused_cuts_the_air_at_once():
    host = Host(Stubborn(lowest_p3=170e3))
    host.run(2.5)
    assert host.rig.asked == 1 and all(one["p3_pa"] >= 170e3 for one in host.rig.commands)


def a_rig_that_does_not_confirm_is_commanded_again_and_not_polled():
    host = Host(Stubborn(tries=40))
    host.run(3.5)
    assert 1 < host.rig.asked < 40, host.rig.asked
    polled, asked, at_s = host.rig.polled, host.rig.asked, host.now_s
    host.run(1.0)
    assert host.rig.polled == polled, "its heartbeat would go on"
    rate_hz = (host.rig.asked - asked) / (host.now_s - at_s)
    assert 8.0 <= rate_hz <= 11.0, rate_hz
    notes = [words for words in host.notes() if "did not confirm" in words]
    assert len(notes) == 1, notes
    host.run(5.0)
    assert host.rig.asked == 40 and host.rig.polled > polled, (host.rig.asked, host.rig.polled)


def a_rig_that_never_confirms_is_given_up_only_where_nobody_listens():
    listened = Host(Stubborn(tries=10**9))
    listened.run(100.0)
    assert not listened.server.over() and not listened.rig.disarmed
    host = Host(Stubborn(tries=10**9))
    host.server.leave(host.now_s)
    host.run(39.0)
    assert not host.server.over()
    host.run(5.0)
    assert host.server.over(), host.now_s


def a_disarm_that_is_not_confirmed_fails():
    host = Host(Stubborn(tries=3))
    assert "error" in host.ask("disarm") and "error" in host.ask("disarm") and not host.rig.disarmed
    assert "result" in host.ask("disarm") and host.rig.disarmed


def what_is_held_is_what_was_set_and_nothing_else():
    host = Host(Stubborn())
    assert "result" in host.ask("hold") and host.rig.commands == ["hold"]
    host.ask("make_safe")
    assert host.ask("hold")["error"]["code"] == "out_of_order", "what was set before would bring the air back"
    host.ask("set", **SETPOINTS)
    host.run(2.2)
    assert host.ask("hold")["error"]["code"] == "lease_ended"
    assert host.rig.commands.count("hold") == 1


def in_simulated_time_the_way_down_stands_in_the_time_of_the_rig():
    host = Host(Stubborn(simulated=True))
    host.ask("poll", until_s=5.0)
    host.server.leave(host.now_s)
    for _ in range(1000):
        if host.server.over():
            break
        host.server.tick(host.now_s)
    assert host.server.over() and host.rig.disarmed and host.rig.asked >= 1
    steps = [a["p3_pa"] - b["p3_pa"] for a, b in zip(host.rig.commands, host.rig.commands[1:])]
    assert len(steps) >= 5 and all(abs(step - 10e3) < 1.0 for step in steps), steps


def what_cannot_be_set_is_refused_and_changes_nothing():
    host = Host(Stubborn())
    for key, value in [("p3_pa", 1e9), ("p3_pa", None), ("t3_k", float("nan")), ("valve_opening_ratio", "1"), ("oil_temperature_k", [])]:
        error = host.ask("set", **{**SETPOINTS, key: value})["error"]
        assert (error["code"], error["setpoint"]) == ("setpoint_out_of_range", key), error
    assert not host.rig.commands


def no_bytes_end_it_or_make_it_take_memory():
    chance = random.Random(17)
    for _ in range(3000):
        read_frame(io.BytesIO(chance.randbytes(chance.randrange(64))))
    assert read_frame(io.BytesIO(struct.pack(">I", 2**32 - 1) + b"x")) is None
    assert read_frame(io.BytesIO(struct.pack(">I", 5) + b"{}")) is None
    host = Host(Stubborn())
    things = [None, True, -1, 1e308, "x", [], {}, [[]], {"major": 1}, "hello", "set", "arm", "__class__", "poll", "describe"]
    for _ in range(5000):
        message = {key: chance.choice(things) for key in ("id", "method", "params", "session", "deadline_s") if chance.random() < 0.8}
        if chance.random() < 0.7:
            message["session"] = host.server.session
        host.server.take(host.now_s, message)
        host.server.tick(host.now_s)
        json.dumps(host.server.out)
        host.server.out.clear()


def drive_fast():
    """A rig in real time that fills a pipe at once, five messages a hundredth of a second, and prints its commands on standard error."""

    print("noise of an author, before the first message")

    class Fast(mapper_driver.Rig):
        def arm(self):
            os.write(1, b"noise of a library in C\n")

        def describe(self):
            return description(["N", "P3"], 100.0, False, ACCEPTS, {"p3_slew_pa_s": 100e3, "valve_opening_ratio": 1.0, "within_s": 20.0}, [])

        def set(self, setpoints):
            print("set", setpoints["t3_k"], file=sys.stderr, flush=True)

        def make_safe(self):
            print("safe", file=sys.stderr, flush=True)

        def poll(self, until_s):
            rows = 5 * mapper_driver.ROWS
            return [until_s + 1e-6 * row for row in range(rows)], {"N": [1.0] * rows, "P3": [1.0] * rows}, []

    mapper_driver.serve("fast", "1", lambda _: Fast())


def a_pipe_that_nobody_reads_holds_up_no_rig():
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    child = subprocess.Popen([sys.executable, __file__, "fast"], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    session = None

    def send(number, method, **params):
        body = json.dumps({"id": number, "method": method, "params": params, "session": session}).encode()
        child.stdin.write(struct.pack(">I", len(body)) + body)
        child.stdin.flush()

    def answer(number):
        messages = []
        while not messages or messages[-1].get("id") != number:
            messages.append(json.loads(read_frame(child.stdout)))
            assert len(messages) < 5000, f"no answer to request {number}"
        return messages

    send(1, "hello", magic=mapper_driver.MAGIC, protocol=mapper_driver.VERSION)
    session = answer(1)[-1]["result"]["session"]
    for number, method in enumerate(["configure", "describe", "arm", "set"], start=2):
        send(number, method, **({"settings": None} if method == "configure" else SETPOINTS if method == "set" else {}))
    # Nothing is read: the lease ends, and the way is flown.
    commands = []
    while not commands or commands[-1] != "safe":
        commands.append(child.stderr.readline().decode().strip())
    noise = [words for words in commands if words.startswith("noise")]
    commands = [words for words in commands if words not in noise]
    assert noise == ["noise of a library in C"], noise
    # Each tenth of a second, or later where this computer is busy.
    assert len(commands) > 2 and commands[0] == "set 800.0" and set(commands[1:-1]) == {"set 350.0"}, commands
    send(6, "make_safe")
    assert child.stderr.readline().strip() == b"safe", "it is asked again while everything is full"
    messages = answer(6)
    assert "result" in messages[-1], messages[-1]
    assert [one["id"] for one in messages if "id" in one] == [2, 3, 4, 5, 6]
    assert any("lease" in one["params"]["message"] for one in messages if one.get("method") == "note")
    samples = [one for one in messages if one.get("method") == "samples"]
    # Queue, pipe, one in the hand of who writes.
    assert 256 <= len(samples) <= 256 + 65536 // 1000 + 2, len(samples)
    send(7, "poll")
    later = [one for one in answer(7) if one.get("method") == "samples"] or [json.loads(read_frame(child.stdout))]
    assert later[0]["params"]["sequence"] - samples[-1]["params"]["sequence"] > mapper_driver.ROWS, "what was dropped is missing by its number"
    child.stdin.close()
    child.stdout.read()
    assert b"noise of an author" in child.stderr.read(), "what was printed before is not a frame either"
    assert child.wait() == 0


def at_a_socket_hosts_are_served_one_after_the_other():
    with tempfile.TemporaryDirectory() as scratch:
        path = str(pathlib.Path(scratch) / "below" / "python_rig.socket")
        program = pathlib.Path(mapper_driver.__file__).parent / "mapper-backend-python_rig"
        child = subprocess.Popen([sys.executable, program, "--socket", path])
        session = None

        def come():
            while True:
                host = socket.socket(socket.AF_UNIX)
                if host.connect_ex(path) == 0:
                    return host, host.makefile("rb")
                host.close()
                assert child.poll() is None

        def ask(host, number, method, **params):
            body = json.dumps({"id": number, "method": method, "params": params, "session": session}).encode()
            host[0].sendall(struct.pack(">I", len(body)) + body)
            while (answer := json.loads(read_frame(host[1]))).get("id") != number:
                pass
            return answer

        def greeted():
            # The one before has gone, and may still be on its way out.
            while "result" not in (answer := ask(host := come(), 1, "hello", magic=mapper_driver.MAGIC, protocol=mapper_driver.VERSION)):
                assert answer["error"]["code"] == "refused", answer
            return host, answer["result"]["session"]

        sessions = set()
        for _ in range(2):
            host, session = greeted()
            sessions.add(session)
            ask(host, 2, "configure", settings={"real_time": True})
            ask(host, 3, "describe")
            assert "result" in ask(host, 4, "arm") and "result" in ask(host, 5, "set", **SETPOINTS)
            other = ask(come(), 1, "hello", magic=mapper_driver.MAGIC, protocol=mapper_driver.VERSION)
            assert "serves another host" in other["error"]["message"], other
            # Without a word: its rig becomes safe, then the next is served.
            host[0].shutdown(socket.SHUT_RDWR)
        garbage = come()
        garbage[0].sendall(b"GET / HTTP/1.0\r\n\r\n")
        garbage[1].read()  # until it is hung up on
        assert len(sessions) == 2, sessions
        host, session = greeted()
        child.terminate()
        assert child.wait() == 0 and not os.path.exists(path)


if sys.argv[1:] == ["fast"]:
    del sys.argv[1:]  # as `mapper` starts it
    drive_fast()
    sys.exit()

FACTS = [value for name, value in list(globals().items()) if callable(value) and "_" in name and getattr(value, "__module__", "") == "__main__"]
FACTS = [fact for fact in FACTS if fact.__code__.co_argcount == 0 and fact is not drive_fast]
for fact in FACTS:
    fact()
print(json.dumps({"held": [fact.__name__ for fact in FACTS]}))
