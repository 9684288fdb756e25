"""Reads the channels of an MDF file by asammdf.

usage: python read_mdf.py FILE

Prints {channel: {"unit": ..., "t_s": [...], "values": [...]}} with the valid samples.
"""

import json
import sys

import asammdf


def main():
    with asammdf.MDF(sys.argv[1]) as mdf:
        signals = [signal.validate() for signal in mdf.iter_channels(copy_master=True)]
    out = {
        signal.name: {"unit": signal.unit, "t_s": signal.timestamps.tolist(), "values": signal.samples.tolist()} for signal in signals
    }
    json.dump(out, sys.stdout)


if __name__ == "__main__":
    main()
