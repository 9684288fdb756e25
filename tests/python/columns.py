"""Reads every message of a recording's rig topics with the Python mcap package, as columns.

usage: python columns.py FILE

Prints {topic: {"log_time_ns": [...], "sequence": [...], field: [...]}} for all topics under /rig.
"""

import json
import sys

from mcap.reader import make_reader


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    topics = {}
    with open(sys.argv[1], "rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if not channel.topic.startswith("/rig/"):
                continue
            columns = topics.setdefault(channel.topic, {})
            columns.setdefault("log_time_ns", []).append(message.log_time)
            columns.setdefault("sequence", []).append(message.sequence)
            for field, value in json.loads(message.data).items():
                columns.setdefault(field, []).append(value)
    json.dump(topics, sys.stdout)


if __name__ == "__main__":
    main()
