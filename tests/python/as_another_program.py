"""Writes a recording again as another program would: degC and kPa, other field names, nothing but three rig topics.

usage: python as_another_program.py FROM TO

The result has no step markers, plan, campaign or truth; its units stand in the channels' metadata. Prints how many
messages it has per topic.
"""

import json
import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer


def same(value):
    return value


def to_kpa(value):
    return value / 1e3


def to_degc(value):
    return value - 273.15


FIELDS = {
    "/rig/compressor": {
        "speed_rpm": ("speed", "rpm", same),
        "flow_kg_s": ("flow", "kg/s", same),
        "inlet_pressure_pa": ("inlet_pressure", "kPa", to_kpa),
        "inlet_temperature_k": ("inlet_temperature", "degC", to_degc),
        "outlet_pressure_pa": ("outlet_pressure", "kPa", to_kpa),
        "outlet_temperature_k": ("outlet_temperature", "degC", to_degc),
        "housing_temperature_k": ("housing_temperature", "degC", to_degc),
    },
    "/rig/command": {
        "turbine_inlet_pressure_pa": ("turbine_inlet_pressure", "kPa", to_kpa),
        "valve_opening": ("valve_opening", "1", same),
    },
}


def rewrite(source, target):
    writer = Writer(target, compression=CompressionType.ZSTD)
    writer.start(profile="", library="another program")
    channels, counts = {}, {topic: 0 for topic in FIELDS}
    for topic, fields in FIELDS.items():
        schema = {"type": "object", "properties": {name: {"type": "number"} for name, _, _ in fields.values()}}
        schema_id = writer.register_schema(topic, "jsonschema", json.dumps(schema).encode())
        units = {name: unit for name, unit, _ in fields.values()}
        channels[topic] = writer.register_channel(topic, "json", schema_id, units)
    for _, channel, message in make_reader(source).iter_messages(topics=list(FIELDS)):
        values = json.loads(message.data)
        fields = FIELDS[channel.topic]
        data = {name: convert(values[key]) for key, (name, _, convert) in fields.items()}
        writer.add_message(channels[channel.topic], message.log_time, json.dumps(data).encode(), message.log_time)
        counts[channel.topic] += 1
    writer.finish()
    return counts


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as source, open(sys.argv[2], "xb") as target:
        json.dump(rewrite(source, target), sys.stdout)


if __name__ == "__main__":
    main()
