"""Copies a recording without what only a simulator knows: all topics under /truth are left out.

usage: python strip_truth.py FROM TO

Everything else is kept: messages with their times and sequence numbers, attachments, metadata. Prints how many
messages were left out and kept.
"""

import json
import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer


def copy(source, target):
    reader = make_reader(source, validate_crcs=True)
    header = reader.get_header()
    writer = Writer(target, compression=CompressionType.ZSTD)
    writer.start(profile=header.profile, library=header.library)
    for record in reader.iter_metadata():
        writer.add_metadata(record.name, record.metadata)
    for record in reader.iter_attachments():
        writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
    channels, left_out, kept = {}, 0, 0
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if channel.topic.startswith("/truth"):
            left_out += 1
            continue
        if channel.id not in channels:
            schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata)
        writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time,
                           message.sequence)
        kept += 1
    writer.finish()
    return {"left_out": left_out, "kept": kept}


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as source, open(sys.argv[2], "xb") as target:
        json.dump(copy(source, target), sys.stdout)


if __name__ == "__main__":
    main()
