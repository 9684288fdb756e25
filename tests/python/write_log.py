"""Writes a recording again as the log of another program, with that program's own library.

usage: python write_log.py RECORDING TARGET FORMAT [TARGET FORMAT ...]

FORMAT is one of
  csv       pandas: seconds, names with units in brackets
  stand     a log in the manner of a test stand: semicolons, decimal commas, Latin-1, a preamble, German and English names, a row
            of units, gauge pressures, degC, kg/h, date, time of day, seconds and milliseconds, 20 minutes at rest before the
            first step, and a gap of 8 s
  xlsx      openpyxl: names, units, numbers
  mdf4      asammdf: one group a device, compressed blocks
  mdf3      asammdf: the same in version 3.30, as older measuring systems write it
  mcap      mcap: one topic a device, units in the metadata
  tdms      npTDMS: one group a device, all channels waveforms with a start and an increment
  tdms_time npTDMS: one group a device, each with a channel of seconds
  tdms_date npTDMS: the same with a channel of dates
  mat       SciPy: a structure of vectors, compressed; SI units in the names
  mat73     h5py: the same as `save -v7.3` lays it out
  parquet   polars: names with units in brackets, seconds
  arrow     polars: the same as Arrow's file, with dates instead of seconds

No step marks, no campaign, no truth. SI units unless stated otherwise. Prints the steps of the recording, and how far the log's
clock is ahead of the recording's, as one JSON object.
"""

import datetime
import json
import math
import random
import sys

import numpy as np
from mcap.reader import make_reader

TOPICS = ["/rig/compressor", "/rig/turbine", "/rig/ambient", "/rig/command"]
UNITS = {"rpm": "rpm", "kg_s": "kg/s", "pa": "Pa", "k": "K"}


def read(path):
    """Times in s, {topic: {field: values}}, steps."""
    groups, steps = {topic: {} for topic in TOPICS}, []
    times = {topic: [] for topic in TOPICS}
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        start_ns = next(int(m.metadata["start_time_ns"]) for m in reader.iter_metadata())
        for _, channel, message in reader.iter_messages(topics=TOPICS + ["/step"]):
            data = json.loads(message.data)
            if channel.topic == "/step":
                if data["phase"] == "start":
                    steps.append(data["t_s"])
                continue
            times[channel.topic].append((message.log_time - start_ns) / 1e9)
            for field, value in data.items():
                groups[channel.topic].setdefault(field, []).append(value)
    return np.array(times[TOPICS[0]]), {t: {f: np.array(v, dtype=float) for f, v in g.items()} for t, g in groups.items()}, steps


def unit_of(field):
    return next((unit for suffix, unit in UNITS.items() if field.endswith("_" + suffix)), "1")


def flat(groups):
    """Columns of all groups; the group in front of the name."""
    return {f"{topic.split('/')[-1]}_{field}": (values, unit_of(field))
            for topic, fields in groups.items() for field, values in fields.items()}


def write_csv(target, times, groups):
    import pandas

    columns = {"time [s]": times} | {f"{name} [{unit}]": values for name, (values, unit) in flat(groups).items()}
    pandas.DataFrame(columns).to_csv(target, index=False)


def write_xlsx(target, times, groups):
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Log"
    columns = flat(groups)
    sheet.append(["time"] + list(columns))
    sheet.append(["s"] + [unit for _, unit in columns.values()])
    for row in range(len(times)):
        sheet.append([float(times[row])] + [float(values[row]) for values, _ in columns.values()])
    book.save(target)


def write_mdf(target, times, groups, version, **saving):
    import asammdf

    with asammdf.MDF(version=version) as mdf:
        for topic, fields in groups.items():
            device = topic.split("/")[-1]
            # Groups have names since version 4.
            name = "{1}" if version >= "4" else "{0}_{1}"
            signals = [
                asammdf.Signal(values, times, name=name.format(device, field), unit=unit_of(field))
                for field, values in fields.items()
            ]
            mdf.append(signals, acq_name=device, common_timebase=True)
        mdf.save(target, overwrite=True, **saving)


START = np.datetime64("2026-11-22T09:58:21.300000", "us")


def write_tdms(target, times, groups, clock):
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    with TdmsWriter(target) as writer:
        # In pieces, as a logger writes.
        for rows in np.array_split(np.arange(len(times)), 7):
            objects = [RootObject({"name": "stand"})]
            for topic, fields in groups.items():
                group = topic.split("/")[-1]
                objects.append(GroupObject(group))
                if clock:
                    objects.append(ChannelObject(group, "time", clock(times[rows]), {"unit_string": "s"}))
                for field, values in fields.items():
                    properties = {"unit_string": unit_of(field)}
                    if not clock:
                        properties |= {"wf_start_time": START, "wf_start_offset": float(times[0]), "wf_increment": 0.1}
                    objects.append(ChannelObject(group, field, values[rows], properties))
            writer.write_segment(objects)


def stamps(times):
    return START + np.round(times * 1e6).astype("timedelta64[us]")


def frame(times, groups, name):
    import polars

    return polars.DataFrame({name: times} | {f"{name} [{unit}]": values for name, (values, unit) in flat(groups).items()})


def variables(times, groups):
    """The name of a variable has no brackets: the unit stands behind it."""
    words = {"rpm": "_rpm", "kg/s": "_kg_s", "Pa": "_Pa", "K": "_kelvin"}
    columns = {f"{name}{words.get(unit, '')}": values for name, (values, unit) in flat(groups).items()}
    return {"time_s": times} | columns


def write_mat73(target, times, groups):
    import h5py

    with h5py.File(target, "x", userblock_size=512) as file:
        text = file.create_dataset("comment", data=np.array([[ord(letter)] for letter in "not a number"], dtype="u2"))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in variables(times, groups).items():
            column = log.create_dataset(name, data=values[None, :], compression="gzip", chunks=True)
            column.attrs["MATLAB_class"] = np.bytes_("double")
    with open(target, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Tue Dec  1 10:00:00 2026 HDF5 schema 1.00 .".ljust(124))
        stream.write(b"\x00\x02IM")


def write_mat(target, times, groups):
    import scipy.io

    log = variables(times, groups)
    scipy.io.savemat(target, {"log": log, "comment": "not a number", "rig": 7.0}, do_compression=True, long_field_names=True)


def write_parquet(target, times, groups):
    frame(times, groups, "time [s]").write_parquet(target, row_group_size=1000)


def write_arrow(target, times, groups):
    frame(stamps(times), groups, "time").write_ipc(target)


def write_mcap(target, times, groups):
    from mcap.writer import Writer

    with open(target, "xb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="another program")
        for topic, fields in groups.items():
            schema = writer.register_schema(topic, "jsonschema", b"{}")
            units = {field: unit_of(field) for field in fields}
            channel = writer.register_channel(topic.split("/")[-1], "json", schema, units)
            for row, time_s in enumerate(times):
                at_ns = round(time_s * 1e9)
                data = json.dumps({field: float(values[row]) for field, values in fields.items()}).encode()
                writer.add_message(channel, at_ns, data, at_ns)
        writer.finish()


REST_S = 1200.0
AMBIENT_PA = 98_700.0
GAP_S = (30.0, 38.0)


def stand_columns(groups):
    """Name, unit, value in it, value at rest."""
    compressor, turbine = groups["/rig/compressor"], groups["/rig/turbine"]

    def same(value):
        return value

    def gauge_mbar(value):
        return (value - AMBIENT_PA) / 100.0

    def gauge_bar(value):
        return (value - AMBIENT_PA) / 1e5

    def celsius(value):
        return value - 273.15

    def per_hour(value):
        return value * 3600.0

    rest = AMBIENT_PA
    return [
        ("Drehzahl ATL", "U/min", same, compressor["speed_rpm"], 0.0, 0),
        ("Massenstrom Verdichter", "kg/h", per_hour, compressor["flow_kg_s"], 0.0, 3),
        ("Druck vor Verdichter", "mbar rel", gauge_mbar, compressor["inlet_pressure_pa"], rest, 3),
        ("p2_stat", "bar rel", gauge_bar, compressor["outlet_pressure_pa"], rest, 6),
        ("Temperatur vor Verdichter", "\u00b0C", celsius, compressor["inlet_temperature_k"], 298.15, 4),
        ("T_C_out", "\u00b0C", celsius, compressor["outlet_temperature_k"], 298.15, 4),
        ("T Verdichtergeh\u00e4use", "\u00b0C", celsius, compressor["housing_temperature_k"], 298.15, 4),
        ("Turbine mass flow", "kg/h", per_hour, turbine["flow_kg_s"], 0.0, 3),
        ("p3", "bar rel", gauge_bar, turbine["inlet_pressure_pa"], rest, 6),
        ("T3", "\u00b0C", celsius, turbine["inlet_temperature_k"], 298.15, 3),
        ("p4", "mbar rel", gauge_mbar, turbine["outlet_pressure_pa"], rest, 3),
        ("T4", "\u00b0C", celsius, turbine["outlet_temperature_k"], 298.15, 3),
        ("\u00d6ltemperatur ein", "\u00b0C", celsius, turbine["oil_temperature_k"], 298.15, 3),
        ("Umgebungstemperatur", "\u00b0C", celsius, groups["/rig/ambient"]["temperature_k"], 298.15, 3),
    ]


def write_stand(target, times, groups):
    columns = stand_columns(groups)
    chance = random.Random(1)
    start = datetime.datetime(2026, 11, 22, 9, 58, 21, 300000)

    def number(value, digits):
        return f"{value:.{digits}f}".replace(".", ",")

    with open(target, "x", encoding="latin-1", newline="\r\n") as out:
        out.write("Pr\u00fcfstand 7;Versuch 0815\nBediener;M. Muster\nBemerkung;Kennfeld, hei\u00df\n\n")
        names = ["Datum", "Uhrzeit", "Zeit", "t_ms", "Status", "pAmb"] + [column[0] for column in columns]
        units = ["", "", "s", "ms", "", "mbar"] + [column[1] for column in columns]
        out.write(";".join(names) + ";\n" + ";".join(units) + ";\n")

        def row(time_s, values):
            at = start + datetime.timedelta(seconds=time_s)
            clock = at.strftime("%H:%M:%S,") + f"{at.microsecond // 1000:03d}"
            cells = [at.strftime("%d.%m.%Y"), clock, number(time_s, 1), str(round(1000 * time_s)), "OK", number(AMBIENT_PA / 100.0, 1)]
            cells += [number(convert(value), digits) for value, (_, _, convert, _, _, digits) in zip(values, columns)]
            out.write(";".join(cells) + ";\n")

        # At rest with the noise of good sensors, once a second as loggers do that wait.
        for second in range(int(REST_S)):
            values = [column[4] + (0.0 if column[4] == 0.0 else chance.gauss(0.0, 0.02 if column[4] < 1000.0 else 5.0))
                      for column in columns]
            row(float(second), values)
        for index, time_s in enumerate(times):
            if not GAP_S[0] <= time_s < GAP_S[1]:
                row(REST_S + time_s, [column[3][index] for column in columns])
    return REST_S


def write(target, kind, times, groups):
    """Returns how far the log's clock is ahead, s."""
    match kind:
        case "csv":
            write_csv(target, times, groups)
        case "stand":
            return write_stand(target, times, groups)
        case "xlsx":
            write_xlsx(target, times, groups)
        case "mcap":
            write_mcap(target, times, groups)
        case "mdf4":
            write_mdf(target, times, groups, "4.10", compression=2)
        case "mdf3":
            write_mdf(target, times, groups, "3.30")
        case "tdms" | "tdms_time" | "tdms_date":
            write_tdms(target, times, groups, {"tdms_time": np.asarray, "tdms_date": stamps}.get(kind))
        case "mat73":
            write_mat73(target, times, groups)
        case "mat":
            write_mat(target, times, groups)
        case "parquet":
            write_parquet(target, times, groups)
        case "arrow":
            write_arrow(target, times, groups)
        case _:
            sys.exit(__doc__)
    return 0.0


def main():
    source, targets, kinds = sys.argv[1:2], sys.argv[2::2], sys.argv[3::2]
    if not kinds or len(targets) != len(kinds):
        sys.exit(__doc__)
    times, groups, steps = read(*source)
    for target, kind in zip(targets, kinds):
        ahead_s = write(target, kind, times, groups)
    assert not any(math.isnan(step) for step in steps)
    json.dump({"steps_s": steps, "ahead_s": ahead_s, "rows": len(times)}, sys.stdout)


if __name__ == "__main__":
    main()
