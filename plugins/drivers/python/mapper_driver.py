"""Drivers for mapper in Python: one file, only the standard library. docs/reference/protocol.md describes the messages.

An author writes a class with the methods of Rig and calls serve(). Frames, hello, lease, and the safe trajectory without a host
(lease over, input closed, SIGTERM) are done here, over pipes or at a socket. A call that hangs keeps the rig from becoming safe:
every read or write of a rig needs its own deadline. Messages are JSON: their numbers are SI, and None is "no reading".
"""

import hashlib
import json
import os
import queue
import signal
import socket
import stat
import struct
import sys
import threading
import time

MAGIC = "mapper-backend"
VERSION = {"major": 1, "minor": 1}
FRAME_LIMIT_BYTES = 1 << 20
LEASE_S = 2.0
STEP_S = 0.1  # between two setpoints of the safe trajectory
HEATER_OFF_K = 293.15
ATMOSPHERE_PA = 105e3
PATIENCE_S = 20.0  # how long a driver without a host keeps trying after the longest trajectory
WAITING = 256  # queue for a host that does not read; further samples are dropped, which the host detects
KEPT = 64  # extra places for answers and remarks: a rig is in doubt until its answer arrives
ROWS = 500  # samples in one message
LATEST_S = 1e9  # maximum run time of a simulated rig: beyond it the steps of a run-down are lost to rounding
TERMINATE = object()  # queue entry: a signal requests termination

UNITS = {
    "N": "rpm", "m_c": "kg/s", "P1": "Pa", "T1": "K", "P2": "Pa", "T2": "K", "Tc": "K", "m_t": "kg/s", "P3": "Pa", "T3": "K",
    "P4": "Pa", "T4": "K", "Tt": "K", "T_oil": "K", "T_amb": "K", "P3_command": "Pa", "T3_command": "K", "valve_command": "1",
    "T_oil_command": "K",
}


class Refused(Exception):
    """A refused request: code of docs/reference/protocol.md, one sentence, and the data of the code."""

    def __init__(self, code, message, **more):
        super().__init__(message)
        self.failure = {"code": code, "message": message, **more}


class Rig:
    """The interface that an author implements. Times are seconds since arming."""

    def describe(self):
        """A dict as `description` of docs/reference/protocol.md; see description()."""
        raise NotImplementedError

    def arm(self):
        """Arms the rig; time 0."""

    def set(self, setpoints):
        """New setpoints: mode, p3_pa, t3_k, valve_opening_ratio, oil_temperature_k. They are always within `accepts`."""
        raise NotImplementedError

    def hold(self):
        """Hold the last setpoints while an operator checks the rig. Nothing to do if the rig keeps them by itself."""

    def poll(self, until_s):
        """Samples since the last poll, up to until_s: (times, {channel: values}, [(t_s, kind, message)]), and fast samples of P1 and P2 if
        there are any: [(channel, first_s, interval_s, values)]. In real time it is called at the rate of the rig, for the newest sample."""
        raise NotImplementedError

    def make_safe(self):
        """Air off, valve open. At any time while armed, more than once."""
        raise NotImplementedError

    def disarm(self):
        """Disarms the rig."""


def description(channels, sample_rate_hz, simulated_time, accepts, safe, needs_guarded=(), exclusive=None):
    """A description; channels by their symbols, accepts and safe as in docs/reference/protocol.md."""
    return {
        "channels": [{"name": name, "unit": UNITS[name]} for name in channels],
        "sample_rate_hz": sample_rate_hz, "simulated_time": simulated_time, "controls": True, "exclusive": exclusive,
        "needs_guarded": list(needs_guarded), "accepts": accepts, "safe": safe,
    }


def secret(setting):
    """The value of a setting {env: NAME}, from the environment."""
    if setting is None:
        return None
    name = setting.get("env") if isinstance(setting, dict) else None
    if not isinstance(name, str):
        raise Refused("settings", "write {env: NAME}, the name of an environment variable that holds it")
    if not os.environ.get(name):
        raise Refused("settings", f"the environment variable {name} is not set")
    return os.environ[name]


def check(setpoints, accepts):
    """Refuses setpoints that are outside the accepted ranges or not numbers."""
    for key in ("p3_pa", "t3_k", "valve_opening_ratio", "oil_temperature_k"):
        value, (low, high) = setpoints.get(key), accepts[key]
        if not isinstance(value, (int, float)) or not low <= value <= high:
            number = value if isinstance(value, (int, float)) and value == value and abs(value) < 1e300 else None
            raise Refused("setpoint_out_of_range", f"{key} is {value}; the rig accepts {low} to {high}",
                          setpoint=key, value=number, low=low, high=high)


class Server:
    """The driver's reaction to each message and each tick; time is an argument."""

    def __init__(self, name, version, open_rig):
        self.name, self.version, self.open_rig = name, version, open_rig
        self.session = f"{os.getpid()}-{time.time_ns()}"
        self.rig = self.about = self.armed = None
        self.greeted = self.leaving = False
        self.out = []

    def over(self):
        return self.leaving and self.armed is None

    def begin(self, now_s):
        """Starts time and lease at the first message or tick after arming, which may take seconds."""
        if self.armed and self.armed.pop("fresh", False):
            self.armed["at_s"], self.armed["lease_s"] = now_s, now_s + LEASE_S

    def take(self, now_s, message):
        self.begin(now_s)
        known = message.get("session") == self.session
        if self.armed and known:
            self.armed["lease_s"] = now_s + LEASE_S
        identity, method = message.get("id"), message.get("method")
        if identity is None or method is None:
            return
        try:
            if method != "hello" and not self.greeted:
                raise Refused("out_of_order", "hello comes first")
            if method != "hello" and not known:
                raise Refused("refused", "the message belongs to another session")
            call = getattr(self, "on_" + str(method), None)
            if call is None:
                raise Refused("unknown_method", f"unknown method `{method}`")
            self.out.append({"id": identity, "result": call(message.get("params") or {}, now_s)})
        except Refused as refused:
            self.out.append({"id": identity, "error": refused.failure})
        except Exception as error:  # an author's mistake is an answer, not the end of the driver
            self.out.append({"id": identity, "error": {"code": "lost", "message": f"the driver failed: {error!r}"}})

    def on_hello(self, params, _):
        if params.get("magic") != MAGIC or params.get("protocol", {}).get("major") != VERSION["major"]:
            raise Refused("refused", f"this driver uses version {VERSION['major']}.{VERSION['minor']} of the protocol {MAGIC}")
        self.greeted = True
        return {"magic": MAGIC, "protocol": VERSION, "name": self.name, "version": self.version,
                "frame_limit_bytes": FRAME_LIMIT_BYTES, "session": self.session}

    def on_configure(self, params, _):
        if self.rig:
            raise Refused("out_of_order", "the settings were already sent")
        self.rig = self.open_rig(params.get("settings"))
        self.about = self.rig.describe()
        return {}

    def on_describe(self, _, __):
        if not self.rig:
            raise Refused("out_of_order", "no settings were sent; send `configure` first")
        text = json.dumps(self.about, sort_keys=True).encode()
        return {"description": self.about, "identity": hashlib.sha256(text).hexdigest()}

    def on_arm(self, _, now_s):
        if not self.rig or self.armed:
            raise Refused("out_of_order", "the rig is armed" if self.armed else "no settings were sent; send `configure` first")
        self.rig.arm()
        self.armed = {"fresh": True, "at_s": now_s, "setpoints": None, "ticks": 0, "sequence": 0, "polled_s": 0.0, "lease_s": now_s + LEASE_S,
                      "descent": None, "ended": False}
        return {}

    def held(self):
        if not self.armed:
            raise Refused("out_of_order", "the rig is not armed")
        return self.armed

    def on_set(self, params, _):
        armed = self.held()
        if armed["ended"]:
            raise Refused("lease_ended", "the lease has ended and the rig was made safe; disarm it and arm it again")
        if self.about["accepts"]:
            check(params, self.about["accepts"])
        self.rig.set(params)
        armed["setpoints"] = params
        return {}

    def on_hold(self, _, __):
        armed = self.held()
        if armed["ended"]:
            raise Refused("lease_ended", "the lease has ended and the rig was made safe; disarm it and arm it again")
        if not armed["setpoints"]:
            raise Refused("out_of_order", "no setpoints to hold: none were set since arming or since it was made safe")
        self.rig.hold()
        return {}

    def on_poll(self, params, _):
        armed, until_s = self.held(), params.get("until_s")
        if not self.about["simulated_time"]:
            raise Refused("unknown_method", "this rig runs in real time and sends its samples unrequested")
        if not isinstance(until_s, (int, float)) or not abs(until_s) <= LATEST_S:
            raise Refused("params", f"until_s is not a number, or beyond {LATEST_S} s")
        self.measure(until_s)
        armed["polled_s"] = max(armed["polled_s"], until_s)
        return {"next_sequence": armed["sequence"]}

    def on_make_safe(self, _, __):
        armed = self.held()
        self.rig.make_safe()
        armed["descent"], armed["setpoints"], armed["in_doubt"] = None, None, False
        return {}

    def on_disarm(self, _, __):
        armed = self.held()
        if armed["setpoints"] or armed["descent"]:
            self.on_make_safe(None, None)  # a rig is not disarmed before it confirms
        self.rig.disarm()
        self.armed = None
        return {}

    def measure(self, until_s):
        """Polls the rig and sends its samples in pieces."""
        times, columns, events, *fast = self.rig.poll(until_s)
        for channel, first_s, interval_s, values in fast[0] if fast else []:
            samples = {"stream": "rig", "sequence": self.armed["sequence"], "t_s": [], "columns": []}
            samples["fast"] = [{"channel": channel, "first_s": first_s, "interval_s": interval_s, "values": values}]
            self.out.append({"method": "samples", "params": samples})
        for start in range(0, len(times), ROWS) if times else ([0] if events else []):
            end = start + ROWS
            last = end >= len(times)
            samples = {
                "stream": "rig", "sequence": self.armed["sequence"] + start, "t_s": times[start:end],
                "columns": [{"channel": name, "values": values[start:end]} for name, values in columns.items()],
            }
            if last and events:
                samples["events"] = [{"t_s": t_s, "kind": kind, "message": words} for t_s, kind, words in events]
            self.out.append({"method": "samples", "params": samples})
        self.armed["sequence"] += len(times)

    def say(self, words):
        self.out.append({"method": "note", "params": {"message": words}})

    def leave(self, now_s):
        """The host has disconnected: makes the rig safe, then ends."""
        self.begin(now_s)
        if not self.leaving:
            self.leaving = True
            self.begin_descent(now_s)

    def run_s(self, now_s):
        return self.armed["polled_s"] if self.about["simulated_time"] else now_s - self.armed["at_s"]

    def begin_descent(self, now_s):
        armed = self.armed
        if armed and not armed["ended"]:
            armed["ended"] = True
            armed["descent"] = (armed["setpoints"], self.run_s(now_s))

    def tick(self, now_s):
        """Does what is due; returns the time to the next task, s, or None."""
        self.begin(now_s)
        armed = self.armed
        if not armed:
            return None
        if now_s >= armed["lease_s"] and not armed["ended"]:
            self.say("no message arrived during the lease; the rig executes its safe trajectory")
            self.begin_descent(now_s)
        next_s = max(0.0, armed["lease_s"] - now_s) if not armed["ended"] else 1.0
        # A rig that does not confirm its safe state is not polled, so that the watchdog on the driver acts.
        if not self.about["simulated_time"] and not armed.get("in_doubt"):
            period_s = 1.0 / self.about["sample_rate_hz"]
            due = max(0, int((now_s - armed["at_s"]) / period_s + 5e-7))
            if due >= armed["ticks"]:
                armed["ticks"] = due + 1
                try:
                    self.measure(due * period_s)
                except Refused as refused:
                    self.out.append({"method": "lost", "params": refused.failure})
                except Exception as error:
                    self.out.append({"method": "lost", "params": {"code": "lost", "message": f"the driver failed: {error!r}"}})
            next_s = min(next_s, armed["ticks"] * period_s - (now_s - armed["at_s"]))
        if armed["descent"]:
            next_s = min(next_s, self.descend(now_s))
        if self.leaving and not armed["descent"]:
            self.cut_air()
            try:
                self.rig.disarm()
            except Exception:
                pass  # no host to report to
            self.armed = None
        return max(0.0, next_s)

    def descend(self, now_s):
        """Valve open and heater off at once, P3 down at its slew, then the air off."""
        armed = self.armed
        if not self.about["simulated_time"] and now_s < armed.get("due_s", 0.0):
            return armed["due_s"] - now_s
        armed["due_s"] = now_s + STEP_S
        setpoints, begun_s = armed["descent"]
        safe, simulated = self.about["safe"], self.about["simulated_time"]
        after_s = self.run_s(now_s) - begun_s + STEP_S
        if not armed.get("cut"):
            try:
                wanted = self.on_the_way(setpoints, safe, after_s)
                if wanted:
                    self.rig.set(wanted)
                    if simulated:
                        armed["polled_s"] += STEP_S
                        self.rig.poll(armed["polled_s"])
                    return 0.0 if simulated else STEP_S
            except Exception:
                pass  # cut the air at once
            armed["cut"] = True
        if self.cut_air():
            armed["descent"], armed["setpoints"], armed["in_doubt"] = None, None, False
        else:
            if not armed.get("in_doubt"):
                self.say("the rig did not confirm its safe state; the command is repeated")
            armed["in_doubt"] = True
            if simulated:
                armed["polled_s"] += STEP_S
            if self.leaving and after_s > safe["within_s"] + PATIENCE_S:
                armed["descent"] = None  # no host, and the rig does not answer
        return STEP_S

    def on_the_way(self, setpoints, safe, after_s):
        """Setpoints of the safe trajectory after_s from its start; None: cut the air."""
        slew_pa_s = safe.get("p3_slew_pa_s")
        if not (setpoints and setpoints.get("mode") == "running" and slew_pa_s and after_s <= safe["within_s"]):
            return None
        p3_pa = setpoints["p3_pa"] - slew_pa_s * after_s
        if p3_pa <= ATMOSPHERE_PA:
            return None
        wanted = {
            **setpoints,
            "p3_pa": p3_pa,
            "t3_k": HEATER_OFF_K,
            "valve_opening_ratio": max(setpoints["valve_opening_ratio"], safe["valve_opening_ratio"]),
        }
        # A command that the rig refuses would cut the air at full pressure.
        accepts = self.about.get("accepts") or {}
        for key in ("t3_k", "valve_opening_ratio"):
            if key in accepts:
                low, high = accepts[key]
                wanted[key] = max(min(wanted[key], high), low)
        return wanted

    def cut_air(self):
        try:
            self.rig.make_safe()
            return True
        except Exception:
            return False


def read_frame(stream):
    """The next message; None at the end of the stream, or for an invalid frame."""
    head = stream.read(4)
    if len(head) < 4:
        return None
    (length,) = struct.unpack(">I", head)
    if not 0 < length <= FRAME_LIMIT_BYTES:
        return None
    body = stream.read(length)
    return body if len(body) == length else None


def serve(name, version, open_rig):
    """Serves one host on standard input and output, or with `--socket PATH` hosts that connect there, one after the other. open_rig(settings)
    makes the Rig; the file of the driver is mapper-backend-NAME."""
    news = queue.Queue(WAITING)
    # Output of the author's print() or a C library goes to standard error: it must not get between the frames.
    frames = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    for number in (signal.SIGTERM, signal.SIGINT, getattr(signal, "SIGHUP", signal.SIGTERM)):
        signal.signal(number, lambda *_: None)
    # The interpreter runs handlers in the main thread, and not if the signal comes just before that thread begins to wait for `news`.
    signalled, wakes = os.pipe()
    os.set_blocking(wakes, False)
    signal.set_wakeup_fd(wakes, warn_on_full_buffer=False)

    def forward_signals():
        while os.read(signalled, 1):
            news.put(TERMINATE)

    threading.Thread(target=forward_signals, daemon=True).start()

    def write(frame):
        frames.write(frame)
        frames.flush()

    if len(sys.argv) == 1:
        serve_one(Server(name, version, open_rig), sys.stdin.buffer, write, news)
    elif len(sys.argv) == 3 and sys.argv[1] == "--socket":
        serve_at(sys.argv[2], name, version, open_rig, news)
    else:
        sys.exit(f"{os.path.basename(sys.argv[0])} is a driver: `mapper` starts it without arguments; with --socket PATH it serves the hosts that connect to this socket")


def serve_at(path, name, version, open_rig, news):
    """Serves the hosts of a socket that only the user can access. A host that connects while another is served is refused."""
    try:
        listener = listen_at(path)
    except OSError as error:
        sys.exit(f"{path}: {error}")
    serve_hosts(listener, path, name, version, open_rig, news)


def serve_hosts(listener, path, name, version, open_rig, news):
    """Serves the hosts that connect to this listener, until TERMINATE is in `news`."""
    busy = threading.Lock()

    def open_the_door():
        while True:
            try:
                host, _ = listener.accept()
            except OSError:
                return
            if busy.acquire(blocking=False):
                news.put(host)
            else:
                turn_away(host)

    threading.Thread(target=open_the_door, daemon=True).start()
    try:
        came = None
        while came is not TERMINATE:
            came = news.get()
            if isinstance(came, socket.socket):
                with came, came.makefile("rb") as stdin:
                    asked_to_end = serve_one(Server(name, version, open_rig), stdin, came.sendall, news)
                    hang_up(came)
                came = TERMINATE if asked_to_end else None
                busy.release()
    finally:
        hang_up(listener)  # ends the thread that waits for hosts
        listener.close()
        if os.path.lexists(path):
            os.unlink(path)


def listen_at(path):
    """A socket that listens at this path. Removes the socket of a killed driver."""
    os.makedirs(os.path.dirname(os.path.abspath(path)), mode=0o700, exist_ok=True)
    listener = socket.socket(socket.AF_UNIX)
    if os.path.lexists(path):
        if not stat.S_ISSOCK(os.lstat(path).st_mode):
            raise OSError("the file exists and is not a socket")
        with socket.socket(socket.AF_UNIX) as probe:
            if probe.connect_ex(path) == 0:
                raise OSError("another driver listens on this socket")
        os.unlink(path)
    listener.bind(path)
    os.chmod(path, 0o600)
    listener.listen()
    return listener


def hang_up(host):
    try:
        host.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass  # already disconnected


def turn_away(host):
    """Answers the first request with a refusal."""
    try:
        host.settimeout(1.0)
        with host, host.makefile("rb") as stdin:
            identity = json.loads(read_frame(stdin) or b"null")["id"]
            words = "this driver serves another host, or is still making its rig safe; try again later"
            body = json.dumps({"id": identity, "error": {"code": "refused", "message": words}}).encode()
            host.sendall(struct.pack(">I", len(body)) + body)
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        pass  # disconnected, or not a valid request


def serve_one(server, stdin, write, news):
    """Serves this host until it disconnects and the rig is safe; write() takes a frame. Returns whether a signal requested termination."""
    to_write = queue.Queue(WAITING + KEPT)
    asked_to_end = False

    def listen():
        try:
            while (body := read_frame(stdin)) and (message := json.loads(body)) is not None:
                news.put(message)
        except (OSError, ValueError, RecursionError):
            pass  # disconnected, or the start of the next frame is unknown
        news.put(None)

    def send_all():
        try:
            while (body := to_write.get()) is not None:
                write(struct.pack(">I", len(body)) + body)
        except (OSError, ValueError):
            return

    for work in (listen, send_all):
        threading.Thread(target=work, daemon=True).start()

    def heed(message):
        nonlocal asked_to_end
        if message is TERMINATE:
            asked_to_end = True
        if message is None or message is TERMINATE:
            server.leave(time.monotonic())
        elif isinstance(message, dict):
            server.take(time.monotonic(), message)

    def send():
        for message in server.out:
            if message.get("method") in ("samples", "lost") and to_write.qsize() >= WAITING:
                continue  # the host detects the gap, or it is sent later
            try:
                to_write.put_nowait(json.dumps(message, allow_nan=False).encode())
            except queue.Full:
                pass  # the request times out at the host
            except Exception as error:  # e.g. numpy's numbers, which json does not support
                print(f"not sent: {error!r}; give plain numbers and texts", file=sys.stderr)
        server.out.clear()

    try:
        while not server.over():
            try:
                while True:  # messages that arrived while the rig was busy count as in time
                    heed(news.get_nowait())
            except queue.Empty:
                pass
            within_s = server.tick(time.monotonic())
            send()
            if server.over():
                break
            try:
                heed(news.get(timeout=within_s))
            except queue.Empty:
                pass
            send()
    finally:
        # After any failure above, the air is cut.
        if server.armed:
            server.cut_air()
            try:
                server.rig.disarm()
            except Exception:
                pass  # no host to report to
        try:
            to_write.put_nowait(None)
        except queue.Full:
            pass  # the writer ends with the pipe
    return asked_to_end
