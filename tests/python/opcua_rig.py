"""The small rig of plugins/drivers/python in real time behind asyncua, an OPC UA server that shares no code with the driver.

Usage: opcua_rig.py [PORT] [--secure DIRECTORY [--user NAME] [--password WORD] [--days N]] [--seed N] [--stamps] [--sessions N] [--misdeeds NAME=KIND,...] [--answers CODE] [--actuators JSON]. Prints the port, then serves until standard input is closed. Nodes: ns=2;s=NAME for each
reading and setpoint (p3, t3, valve, oil_temperature), air (Boolean), heartbeat (UInt32), tripped (Boolean); text, flag, table, whole (of other types). As a PLC has to, it cuts the
air by itself if the heartbeat stops. Values that no stand could bear are refused with BadOutOfRange.

With --secure it takes signed and encrypted sessions alone, of the user `lab` with the password `hunter2` by default; the certificate is made in the directory
if it has none yet, valid for a year or for N days. With --stamps it prints `SECONDS read RPM` for each speed that it hands out and `SECONDS write NAMES` for each set-point that it
takes, on the clock of time.monotonic(): behind its decryption, so that a session may be encrypted. With --sessions it holds so many sessions at a time and
refuses others with BadTooManySessions, as small PLCs do: a session, also one without a successful login, is held until its client closes it.
With --misdeeds, from the first time that the air is on, readings become: `boolean`, a truth value; `int64`, a whole number; `text`; `null`; `inf`; `future`, `past`, stamped an hour off;
`unstamped`; a number, with that status code; the name of a status code, with it. With --answers CODE writes of
setpoints are answered with that status.
"""

import argparse
import asyncio
import datetime
import json
import logging
import math
import pathlib
import socket
import sys
import time

import slow_rig
from asyncua import Server, ua
from asyncua.crypto.cert_gen import dump_private_key_as_pem, generate_private_key, generate_self_signed_app_certificate
from asyncua.common.utils import ServiceError
from asyncua.server.uaprocessor import UaProcessor
from asyncua.server.user_managers import UserManager
from asyncua.crypto.permission_rules import User, UserRole
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID

CHANNELS = ["N", "m_c", "P1", "T1", "P2", "T2", "Tc", "m_t", "P3", "T3", "P4", "T4", "Tt", "T_oil", "T_amb"]
SETPOINTS = {"p3": ("p3_pa", 110e3, 500e3), "t3": ("t3_k", 298.15, 950.0), "valve": ("valve_opening_ratio", 1.0, 2.5),
             "oil_temperature": ("oil_temperature_k", 323.15, 420.0)}
WATCHDOG_S = 2.0
NAMESPACE = "urn:mapper:tests:stand"
APPLICATION = "urn:mapper:tests:server"

class Users(UserManager):
    def __init__(self, name, password):
        self.only = (name, password)

    def get_user(self, iserver, username=None, password=None, certificate=None):
        return User(role=UserRole.User) if (username, password) == self.only else None


def certificate(directory, days):
    """The files of a certificate of the server's own."""
    key, cert = directory / "key.pem", directory / "cert.der"
    directory.mkdir(parents=True, exist_ok=True)
    if not cert.exists():
        secret = generate_private_key()
        names = [x509.UniformResourceIdentifier(APPLICATION), x509.DNSName("localhost")]
        both = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
        made = generate_self_signed_app_certificate(secret, "stand", {}, names, both, days)
        key.write_bytes(dump_private_key_as_pem(secret))
        cert.write_bytes(made.public_bytes(Encoding.DER))
    return key, cert


async def make(arguments):
    server = Server(user_manager=Users(arguments.user, arguments.password) if arguments.secure else None)
    await server.init()
    await server.set_application_uri(APPLICATION)
    server.set_endpoint(f"opc.tcp://127.0.0.1:{arguments.port}/")
    if arguments.secure:
        key, cert = certificate(pathlib.Path(arguments.secure), arguments.days)
        await server.load_certificate(str(cert))
        await server.load_private_key(str(key))
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        server.set_identity_tokens([ua.UserNameIdentityToken])
    else:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    index = await server.register_namespace(NAMESPACE)
    assert index == 2
    stand = await server.nodes.objects.add_object(index, "Stand")
    nodes = {}
    for name in CHANNELS:
        nodes[name] = await stand.add_variable(ua.NodeId(name, index), name, 0.0, ua.VariantType.Double)
    for name, (_, first, _) in SETPOINTS.items():
        nodes[name] = await stand.add_variable(ua.NodeId(name, index), name, first, ua.VariantType.Float)
    nodes["air"] = await stand.add_variable(ua.NodeId("air", index), "air", False, ua.VariantType.Boolean)
    nodes["heartbeat"] = await stand.add_variable(ua.NodeId("heartbeat", index), "heartbeat", 0, ua.VariantType.UInt32)
    # What campaigns name by mistake: a text, a truth value, a table, whole numbers.
    for name, value, kind in [("text", "12.5", ua.VariantType.String), ("flag", False, ua.VariantType.Boolean),
                              ("table", [1.0, 2.0], ua.VariantType.Double), ("whole", 1, ua.VariantType.Int16)]:
        nodes[name] = await stand.add_variable(ua.NodeId(name, index), name, value, kind)
    nodes["tripped"] = await stand.add_variable(ua.NodeId("tripped", index), "tripped", False, ua.VariantType.Boolean)
    for name in [*SETPOINTS, "air", "heartbeat", "flag", "whole"]:
        await nodes[name].set_writable()
    refuse_what_is_too_much(server, index, arguments.answers)
    if arguments.misdeeds:
        # asyncua keeps the type of a node; not every PLC does.
        server.iserver.aspace._is_expected_variant_type = lambda *_: True
    if arguments.sessions is not None:
        hold_at_most(server.iserver, arguments.sessions)
    return server, nodes


def hold_at_most(iserver, most):
    """No more sessions than these, each held until its client closes it: what asyncua itself drops with the connection, many PLCs keep for minutes."""
    create, lost, held = iserver.create_session, UaProcessor.close, set()

    async def close_of_connection(processor):
        if processor.session:
            processor.session.is_left_behind = True
        await lost(processor)

    def limited(*args, external=False, **kwargs):
        if external and len(held) >= most:
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        session = create(*args, external=external, **kwargs)
        if external:
            held.add(session)
            close = session.close_session

            async def closed(*args):
                if not getattr(session, "is_left_behind", False):
                    held.discard(session)
                await close(*args)

            session.close_session = closed
        return session

    iserver.create_session, UaProcessor.close = limited, close_of_connection


def refuse_what_is_too_much(server, index, answers):
    """Writes beyond the stand's own limits are refused, as a PLC does; others are answered with Good, or with the status named."""
    service = server.iserver.attribute_service
    write = service.write

    async def checked(params, user):
        results = []
        for one in params.NodesToWrite:
            limit = SETPOINTS.get(one.NodeId.Identifier) if one.NodeId.NamespaceIndex == index else None
            if limit and one.Value.Value.Value > limit[2]:
                results.append(ua.StatusCode(ua.StatusCodes.BadOutOfRange))
                continue
            single = ua.WriteParameters()
            single.NodesToWrite = [one]
            written = await write(single, user)
            results += [ua.StatusCode(getattr(ua.StatusCodes, answers))] if limit and answers else written
        return results

    service.write = checked


def stamp(server, index):
    """What was read and commanded, when, as the server itself sees it: before it encrypts the answer, after it has decrypted the request."""
    service = server.iserver.attribute_service
    read, write = service.read, service.write
    speed = ua.NodeId("N", index)

    def stamped_read(params):
        results = read(params)
        for one, result in zip(params.NodesToRead, results):
            if one.NodeId == speed and one.AttributeId == ua.AttributeIds.Value:
                print(f"{time.monotonic():.6f} read {result.Value.Value}", flush=True)
        return results

    async def stamped_write(params, user):
        now = time.monotonic()
        names = [one.NodeId.Identifier for one in params.NodesToWrite if one.NodeId.NamespaceIndex == index]
        if commanded := [name for name in names if name in SETPOINTS or name == "air"]:
            print(f"{now:.6f} write {','.join(commanded)}", flush=True)
        return await write(params, user)

    service.read, service.write = stamped_read, stamped_write


async def live(server, nodes, seed, filled, misdeeds, actuators):
    """The rig follows its nodes, and fills them; says when it has done so first."""

    async def put(name, value, kind, misdeed=None):
        now = datetime.datetime.now(datetime.timezone.utc)
        hour = datetime.timedelta(hours=1)
        taken = {"future": now + hour, "past": now - hour, "unstamped": None}.get(misdeed, now)
        number = int(misdeed, 16) if (misdeed or "").startswith("0x") else None
        status = ua.StatusCode(number or getattr(ua.StatusCodes, misdeed or "Good", ua.StatusCodes.Good))
        changed = {"boolean": (True, ua.VariantType.Boolean), "int64": (int(value), ua.VariantType.Int64), "text": (str(value), ua.VariantType.String),
                   "null": (None, ua.VariantType.Null), "inf": (math.inf, ua.VariantType.Double)}
        value, kind = changed.get(misdeed, (value, kind))
        stamped = ua.DataValue(ua.Variant(value, kind), status, SourceTimestamp=taken, ServerTimestamp=now)
        await server.write_attribute_value(nodes[name].nodeid, stamped)

    rig = slow_rig.make({"noise": 1, "seed": seed}, actuators)
    rig.arm()
    begun = time.monotonic()
    beat, beaten = None, begun
    # For good: a busy machine may delay the heartbeat, and the air is cut then.
    misbehaves = False
    while True:
        now = time.monotonic()
        commanded = {key: await nodes[name].read_value() for name, (key, _, _) in SETPOINTS.items()}
        air, heartbeat = await nodes["air"].read_value(), await nodes["heartbeat"].read_value()
        if heartbeat != beat:
            beat, beaten = heartbeat, now
        if now - beaten > WATCHDOG_S and air:
            air = False
            await put("air", False, ua.VariantType.Boolean)
            await put("tripped", True, ua.VariantType.Boolean)
        misbehaves = misbehaves or air
        rig.set({"mode": "running" if air else "standstill", **commanded})
        times, columns, _ = rig.poll(now - begun)
        if times:
            for name in CHANNELS:
                await put(name, columns[name][-1], ua.VariantType.Double, misdeeds.get(name) if misbehaves else None)
            filled.set()
        await asyncio.sleep(0.02)


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("port", nargs="?", type=int, default=0)
    parser.add_argument("--secure")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stamps", action="store_true")
    parser.add_argument("--user", default="lab")
    parser.add_argument("--password", default="hunter2")
    parser.add_argument("--days", type=int, default=365)
    parser.add_argument("--sessions", type=int)
    parser.add_argument("--misdeeds")
    parser.add_argument("--answers")
    parser.add_argument("--actuators", type=json.loads)
    arguments = parser.parse_args()
    logging.disable(logging.ERROR)
    misdeeds = dict(one.split("=") for one in arguments.misdeeds.split(",")) if arguments.misdeeds else {}
    if not arguments.port:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            arguments.port = free.getsockname()[1]
    server, nodes = await make(arguments)
    async with server:
        filled = asyncio.Event()
        living = asyncio.create_task(live(server, nodes, arguments.seed, filled, misdeeds, arguments.actuators))
        # Whoever arms it looks at its readings first.
        await filled.wait()
        print(arguments.port, flush=True)
        if arguments.stamps:
            stamp(server, 2)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        living.cancel()


asyncio.run(main())
