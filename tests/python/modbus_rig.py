"""The small rig of plugins/drivers/python in real time behind pymodbus, a Modbus server that shares no code with the driver.

Usage: modbus_rig.py [PORT [ACTUATORS]], ACTUATORS those of slow_rig.py as JSON. Prints the port, then serves until standard input is closed. Holding registers: readings from 0 as singles (two
registers each, in the order of CHANNELS), setpoints from 100, air 110, heartbeat 111, tripped 112. As a PLC has to, it cuts the air by
itself if the heartbeat stops. Register 150 sets how the server misbehaves from then on (MISDEEDS),
151 how it does.
"""

import asyncio
import json
import math
import struct
import sys
import time

import slow_rig
from pymodbus.pdu import ExceptionResponse
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

CHANNELS = ["N", "m_c", "P1", "T1", "P2", "T2", "Tc", "m_t", "P3", "T3", "P4", "T4", "Tt", "T_oil", "T_amb"]
SETPOINTS = ["p3_pa", "t3_k", "valve_opening_ratio", "oil_temperature_k"]
READ_HOLDING, WRITE_HOLDING = 3, 16
ALL_DEVICES = 0
WATCHDOG_S = 2.0
MISDEED = 150
# Of writes below register 150: acknowledges another register, fewer registers, is busy each other time (exception 6); of all: closes the
# connection after each answer, or answers with another unit, transaction or function, or one byte short; of reads: every number is NaN or infinite; of
# heartbeats: refuses them; from 100 on writes, from 200 on reads are refused for ever with the exception of the rest.
MISDEEDS = HONEST, OTHER_REGISTER, FEWER_REGISTERS, BUSY_ONCE, CLOSES, OTHER_UNIT, OTHER_TRANSACTION, OTHER_FUNCTION, NAN, INFINITE, NO_HEARTBEAT = range(11)
OF_WRITES, OF_READS = 100, 200
# Byte of a frame, and how it is changed.
OF_FRAMES = {OTHER_UNIT: 6, OTHER_TRANSACTION: 1, OTHER_FUNCTION: 7}

def words(value):
    return list(struct.unpack(">2H", struct.pack(">f", value)))


def number(registers):
    return struct.unpack(">f", struct.pack(">2H", *registers))[0]


class Misdeeds:
    """Changes what goes out, as register 150 says."""

    def __init__(self):
        self.kind, self.writes, self.server = HONEST, 0, None

    def trace(self, sending, pdu):
        if not sending:
            return pdu
        if self.kind == CLOSES:
            for connection in list(self.server.active_connections.values()):
                asyncio.get_running_loop().call_later(0.002, connection.close)
        # The test itself reads one register at a time.
        if self.kind >= OF_READS and pdu.function_code == READ_HOLDING and len(pdu.registers) > 1:
            return self.refusal(pdu, self.kind - OF_READS)
        if self.kind in (NAN, INFINITE) and pdu.function_code == READ_HOLDING and len(pdu.registers) > 1:
            pdu.registers = words(math.nan if self.kind == NAN else math.inf) * (len(pdu.registers) // 2)
        if pdu.function_code != WRITE_HOLDING or pdu.address >= MISDEED:
            return pdu
        if self.kind == NO_HEARTBEAT and pdu.address == 111:
            return self.refusal(pdu, 2)
        self.writes += 1
        if self.kind == OTHER_REGISTER:
            pdu.address += 1
        elif self.kind == FEWER_REGISTERS:
            pdu.count -= 1
        elif self.kind == BUSY_ONCE and self.writes % 2:
            return self.refusal(pdu, 6)
        elif OF_WRITES <= self.kind < OF_READS:
            return self.refusal(pdu, self.kind - OF_WRITES)
        return pdu

    def trace_bytes(self, sending, frame):
        # The test itself writes by function 6, and reads one register at a time.
        if not sending or self.kind not in OF_FRAMES or len(frame) < 12 or frame[7] == 6:
            return frame
        changed = bytearray(frame)
        changed[OF_FRAMES[self.kind]] ^= 7
        return bytes(changed)

    @staticmethod
    def refusal(pdu, code):
        refusal = ExceptionResponse(pdu.function_code, exception_code=code)
        refusal.transaction_id, refusal.dev_id = pdu.transaction_id, pdu.dev_id
        return refusal


async def live(server, filled, misdeeds):
    """The rig follows its registers, and fills them; says when it has done so first."""

    async def get(register, count):
        return await server.async_getValues(1, READ_HOLDING, register, count)

    async def put(register, values):
        await server.async_setValues(1, WRITE_HOLDING, register, values)

    rig = slow_rig.make({"noise": 1}, json.loads(sys.argv[2]) if len(sys.argv) > 2 else None)
    rig.arm()
    begun = time.monotonic()
    beat, beaten = None, begun
    while True:
        now = time.monotonic()
        values = [number(await get(100 + 2 * i, 2)) for i in range(4)]
        air, heartbeat = await get(110, 2)
        (misdeeds.kind,) = await get(MISDEED, 1)
        await put(MISDEED + 1, [misdeeds.kind])
        if heartbeat != beat:
            beat, beaten = heartbeat, now
        if now - beaten > WATCHDOG_S:
            air = 0
            await put(112, [1])
        rig.set({"mode": "running" if air else "standstill", **dict(zip(SETPOINTS, values))})
        times, columns, _ = rig.poll(now - begun)
        if times:
            await put(0, [word for name in CHANNELS for word in words(columns[name][-1])])
            filled.set()
        await asyncio.sleep(0.02)


async def main():
    registers = [0] * 200
    for i, value in enumerate([110e3, 298.15, 1.0, 323.15]):
        registers[100 + 2 * i : 102 + 2 * i] = words(value)
    device = SimDevice(id=ALL_DEVICES, simdata=SimData(0, values=registers, datatype=DataType.REGISTERS))
    address = ("127.0.0.1", int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    misdeeds = Misdeeds()
    server = misdeeds.server = ModbusTcpServer(device, address=address, trace_pdu=misdeeds.trace, trace_packet=misdeeds.trace_bytes)
    await server.serve_forever(background=True)
    filled = asyncio.Event()
    living = asyncio.create_task(live(server, filled, misdeeds))
    # Whoever arms it looks at its readings first.
    await filled.wait()
    print(server.transport.sockets[0].getsockname()[1], flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    living.cancel()
    await server.shutdown()


asyncio.run(main())
