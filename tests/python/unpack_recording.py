"""Everything that a recording holds, unpacked, as one JSON text: messages, metadata, attachments, schemas, channels.

Usage: unpack_recording.py FILE
"""

import json
import sys

from mcap.reader import make_reader

with open(sys.argv[1], "rb") as file:
    reader = make_reader(file)
    summary = reader.get_summary()
    everything = {
        "messages": [[channel.topic, message.data.decode("utf-8", "replace")] for _, channel, message in reader.iter_messages()],
        "metadata": [[one.name, one.metadata] for one in reader.iter_metadata()],
        "attachments": [[one.name, one.data.decode("utf-8", "replace")] for one in reader.iter_attachments()],
        "channels": [[one.topic, one.metadata] for one in summary.channels.values()],
    }
print(json.dumps(everything))
