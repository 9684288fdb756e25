"""Looks on at a run as Foxglove and Lichtblick do, by their WebSocket protocol, and says as JSON what came.

    python view_stream.py mapper run CAMPAIGN --out RUNS --pace 60

One viewer takes everything; another asks for everything and never reads on: it must not slow the run.
"""

import atexit
import json
import re
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

from mcap.reader import make_reader
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

PROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1

run = subprocess.Popen(
    [*sys.argv[1:], "--foxglove=127.0.0.1:0", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
)
atexit.register(run.kill)
url = next(found[1] for line in run.stderr if (found := re.match(r"for Foxglove and Lichtblick: (\S+)", line)))
threading.Thread(target=run.stderr.read, daemon=True).start()
output = []
reader = threading.Thread(target=lambda: output.append(run.stdout.read()), daemon=True)
reader.start()
result = {"url": url}

# A client that speaks another protocol is turned away.
try:
    with connect(url, subprotocols=["something.else"]):
        pass
    result["another_protocol"] = "accepted"
except InvalidStatus as error:
    result["another_protocol"] = error.response.status_code

# The slow one: a small buffer of its own, and nothing taken out of it.
slow = socket.socket()
slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
slow.connect((url.rsplit(":", 1)[0].removeprefix("ws://"), int(url.rsplit(":", 1)[1])))
slow_viewer = connect(url, sock=slow, subprotocols=[PROTOCOL], max_queue=1, ping_interval=None).__enter__()

topics, messages, asked = {}, {}, set()
with connect(url, subprotocols=[PROTOCOL], max_size=None) as viewer:
    result["protocol"] = viewer.subprotocol
    info = json.loads(viewer.recv(timeout=20))
    result["server"] = {"op": info["op"], "name": info["name"], "capabilities": info["capabilities"]}
    # Whatever a viewer writes is not taken: it has no topics, services or parameters of its own.
    viewer.send(json.dumps({"op": "setParameters", "parameters": [{"name": "stop", "value": True}]}))
    try:
        while True:
            message = viewer.recv(timeout=60)
            if isinstance(message, str):
                message = json.loads(message)
                if message["op"] == "advertise":
                    for channel in message["channels"]:
                        topics[channel["id"]] = channel
                    subscribe = [{"id": channel["id"], "channelId": channel["id"]} for channel in message["channels"]]
                    # No person is quicker, and the library knows a topic only a moment after it has announced it.
                    time.sleep(0.2)
                    viewer.send(json.dumps({"op": "subscribe", "subscriptions": subscribe}))
                    slow_viewer.send(json.dumps({"op": "subscribe", "subscriptions": subscribe}))
            elif message[0] == MESSAGE_DATA:
                channel, log_time = struct.unpack_from("<IQ", message, 1)
                messages.setdefault(topics[channel]["topic"], []).append((log_time, json.loads(message[13:])))
    except ConnectionClosed:
        pass

result["exit"] = run.wait(60)
reader.join(10)
printed = json.loads(output[0])
recording = Path(printed["recording"])
# The same topics, schemas, units and times stand in the recording.
with recording.open("rb") as file:
    opened = make_reader(file)
    summary = opened.get_summary()
    recorded = {channel.topic: (summary.schemas[channel.schema_id], channel) for channel in summary.channels.values()}
    values = {}
    for _, channel, message in opened.iter_messages():
        values.setdefault(channel.topic, {}).setdefault(message.log_time, []).append(json.loads(message.data))

result["topics"] = {}
for channel in topics.values():
    topic, schema = channel["topic"], json.loads(channel["schema"])
    numbers = {name: field["unit"] for name, field in schema["properties"].items() if field["type"] == "number"}
    result["topics"][topic] = {
        "encoding": [channel["encoding"], channel["schemaEncoding"]],
        "units": numbers,
        "described": all(field.get("description") for field in schema["properties"].values()),
        "messages": len(messages.get(topic, [])),
        "as_recorded": topic in recorded
        and json.loads(recorded[topic][0].data) == schema
        and recorded[topic][0].encoding == channel["schemaEncoding"],
        # Each message with the value that the recording has at that very time.
        "values_as_recorded": topic in values and all(value in values[topic].get(at, []) for at, value in messages.get(topic, [])),
    }
result["recorded"] = {
    topic: {
        "encoding": [channel.message_encoding, schema.encoding],
        "units": {n: f.get("unit") for n, f in json.loads(schema.data)["properties"].items() if f["type"] == "number"},
        "metadata": dict(channel.metadata),
    }
    for topic, (schema, channel) in recorded.items()
}
layout = json.loads((Path(__file__).parents[2] / "examples/foxglove/mapper.json").read_text())


def leaves(node):
    return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])


fields = {topic: json.loads(schema.data)["properties"] for topic, (schema, _) in recorded.items()}
fields |= {channel["topic"]: json.loads(channel["schema"])["properties"] for channel in topics.values()}
paths = []
for panel in layout["configById"].values():
    paths += [path["value"] for path in panel.get("paths", [])]
    paths += [panel["xAxisPath"]["value"]] if "xAxisPath" in panel else []
    paths += [panel["topicToRender"]] if "topicToRender" in panel else []
    paths += [panel["topicPath"]] if "topicPath" in panel else []
result["layout"] = {
    "panels": sorted(layout["configById"]) == sorted(leaves(layout["layout"])),
    "unknown": [
        path
        for path in paths
        if path.split(".")[0] not in fields or ("." in path and path.split(".")[1] not in fields[path.split(".")[0]])
    ],
    "paths": len(paths),
}
json.dump(result, sys.stdout)
