"""Reads a recording with the Python mcap package and prints what is in it as one JSON object.

usage: python read_recording.py FILE

The object holds, by topic: the number of messages, the units by field from the JSON schema and from the channel's
metadata, and the first and the last message; and the names and sizes of the attachments, and the metadata records.
"""

import json
import sys

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.records import Channel, Message, Schema


def describe(channel, schema):
    properties = json.loads(schema.data).get("properties", {}) if schema and schema.data else {}
    return {
        "message_encoding": channel.message_encoding,
        "schema_encoding": schema.encoding if schema else None,
        "messages": 0,
        "schema_units": {field: entry.get("unit") for field, entry in properties.items()},
        "metadata_units": dict(channel.metadata),
        "first": None,
        "last": None,
    }


def note(entry, message):
    content = {
        "log_time_ns": message.log_time,
        "publish_time_ns": message.publish_time,
        "sequence": message.sequence,
        "data": json.loads(message.data),
    }
    entry["messages"] += 1
    entry["first"] = entry["first"] or content
    entry["last"] = content


def read_whole(path):
    """A finished file, by its index; every checksum is checked."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        if summary is None:
            raise McapError("no index")
        topics = {}
        for schema, channel, message in reader.iter_messages():
            note(topics.setdefault(channel.topic, describe(channel, schema)), message)
        return {
            "complete": True,
            "library": reader.get_header().library,
            "topics": topics,
            "attachments": {a.name: {"media_type": a.media_type, "bytes": len(a.data), "text": a.data.decode("utf-8")}
                            for a in reader.iter_attachments()},
            "metadata": {m.name: m.metadata for m in reader.iter_metadata()},
        }


def read_partial(path):
    """What can be read of a file that was cut short, from its start to where it breaks."""
    topics, schemas, channels = {}, {}, {}
    with open(path, "rb") as stream:
        try:
            for record in StreamReader(stream).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    entry = topics.setdefault(channel.topic, describe(channel, schemas.get(channel.schema_id)))
                    note(entry, record)
        except (McapError, EOFError, ValueError) as error:
            reason = f"{type(error).__name__}: {error}"
        else:
            reason = None
    return {"complete": False, "reason": reason, "topics": topics, "attachments": {}, "metadata": {}}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    try:
        result = read_whole(sys.argv[1])
    except (McapError, EOFError):
        result = read_partial(sys.argv[1])
    json.dump(result, sys.stdout, indent=1, sort_keys=True)
    print()


if __name__ == "__main__":
    main()
