"""Points, maps and diagnoses are those of the command, to the last digit."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mapper
import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

mpl.use("agg")


def test_a_run_is_identified_as_by_the_command(run: mapper.Run, command: Callable[..., Any]) -> None:
    assert run.end == "completed"
    result, expected = mapper.identify(run), command("identify", run.directory)
    assert result.json == expected
    points = result.points
    assert list(points.index) == [point["step"] for point in expected["points"]]
    # NaN differs from itself.
    eta = [point["eta"] for point in expected["points"]]
    assert [None if np.isnan(value) else value for value in points["eta"]] == eta
    assert points.attrs["units"]["h_w_m2k"] == "W/(m^2 K)"
    assert run.json is not None
    assert run.json["points"] == expected["points"]
    assert result._repr_html_().split("</p>")[1] == run._repr_html_().split("</p>")[1]


def test_a_run_has_the_samples_of_the_command_s_run(
    run: mapper.Run, campaign_file: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    by_command = command("run", campaign_file, "--out", tmp_path)
    recording = mapper.Recording.read(by_command["run"])
    pd.testing.assert_frame_equal(run.recording.frame, recording.frame, check_exact=True)


def test_another_campaign_and_method_are_those_of_the_command(
    run: mapper.Run, campaign: mapper.Campaign, campaign_file: Path, command: Callable[..., Any]
) -> None:
    result = mapper.identify(run, campaign, method="joint")
    assert result.json == command("identify", run.directory, "--campaign", campaign_file, "--method", "joint")
    with pytest.raises(mapper.IdentificationError):
        mapper.identify(run, method="guess")


def test_a_frame_gives_the_points_of_its_csv(
    run: mapper.Run, campaign: mapper.Campaign, campaign_file: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    recording = run.recording
    samples = recording.frame
    samples.insert(0, "time", samples.index)
    samples["T_out"] = samples.pop("T2") - 273.15
    units = {symbol: unit for symbol, unit in recording.channels.items() if symbol != "T2"}
    log, channels = tmp_path / "log.csv", tmp_path / "channels.yaml"
    samples.to_csv(log, index=False)
    lines = [f"  {symbol}: {{field: {symbol}, unit: '{unit}'}}" for symbol, unit in units.items()]
    clock = "log: {time: time, time_unit: s, names_row: 1, units_row: 0, data_row: 2}\n"
    channels.write_text("\n".join(["channels:", *lines, "  T2: {field: T_out, unit: degC}", clock]))
    expected = command("identify", log, "--channels", channels, "--campaign", campaign_file)

    mapping = {symbol: f"{symbol} [{unit}]" for symbol, unit in units.items()} | {"T2": "T_out [degC]"}
    by_column = mapper.Recording.from_frame(samples, mapping, time="time")
    assert mapper.identify(by_column, campaign).json["points"] == expected["points"]
    by_index = mapper.Recording.from_frame(samples.drop(columns="time"), mapping)
    assert mapper.identify(by_index, campaign).json["points"] == expected["points"]
    by_file = mapper.Recording.read(log, channels)
    assert mapper.identify(by_file, campaign).json == expected


def test_a_wrong_unit_in_a_frame_has_line_and_caret(run: mapper.Run) -> None:
    samples = run.recording.frame
    with pytest.raises(mapper.RecordingError) as caught:
        mapper.Recording.from_frame(samples, {"T2": "T2 [bar]"})
    assert '"unit": "bar"' in str(caught.value)
    assert "^^^^^" in str(caught.value)
    with pytest.raises(mapper.RecordingError):
        mapper.Recording.from_frame(samples, {"T2": "T9 [K]"})
    with pytest.raises(mapper.RecordingError):
        mapper.Recording.from_frame(samples.reset_index(drop=True), {"T2": "T2 [K]"})


def test_dates_and_durations_are_times(run: mapper.Run) -> None:
    samples = run.recording.frame
    mapping = {symbol: f"{symbol} [{unit}]" for symbol, unit in run.recording.channels.items()}
    seconds = mapper.Recording.from_frame(samples, mapping).frame
    # Microseconds, as a date of pandas has them; the rig's clock has tenths of seconds.
    dated = samples.set_index(pd.Timestamp("2026-01-01") + pd.to_timedelta(samples.index, unit="s").round("us"))
    dates = mapper.Recording.from_frame(dated, mapping).frame
    np.testing.assert_allclose(dates.index, seconds.index, atol=1e-6)
    np.testing.assert_array_equal(dates["T2"], seconds["T2"])


def test_a_log_without_a_machine_is_an_identification_error(run: mapper.Run) -> None:
    mapping = {symbol: f"{symbol} [{unit}]" for symbol, unit in run.recording.channels.items()}
    recording = mapper.Recording.from_frame(run.recording.frame, mapping)
    with pytest.raises(mapper.IdentificationError):
        mapper.identify(recording)


def test_a_campaign_replaces_one_that_cannot_be_read(command: Callable[..., Any], tmp_path: Path) -> None:
    file = tmp_path / "t.yaml"
    text = mapper.Campaign.template(name="t", directory=tmp_path).text
    file.write_text(text.replace("points: 6", "points: 2"))
    campaign = mapper.Campaign.load(file)
    run = campaign.run(tmp_path / "runs")
    # Alone, without the map that its campaign names.
    alone = tmp_path / "alone" / "recording.mcap"
    alone.parent.mkdir()
    shutil.copy(run.directory / "recording.mcap", alone)
    with pytest.raises(mapper.CampaignError):
        mapper.Recording.read(alone)
    recording = mapper.Recording.read(alone, campaign=campaign)
    assert mapper.identify(recording).json == command("identify", alone, "--campaign", file)


def test_the_turbine_has_its_power_over_that_of_an_ideal_one(run: mapper.Run) -> None:
    """The efficiency is a power over `m cp T3' (1 - ER^-kappa)`; cp of air at 500 degC is 1.092 kJ/(kg K)."""
    turbine = mapper.identify(run).turbine_points.dropna(subset="efficiency")
    assert len(turbine) > 8
    power_w = turbine["power_w"]
    flow_kg_s = turbine["flow_parameter_kg_sqrt_k_s_kpa"] * 110.0 * turbine["expansion_ratio"] / 773.15**0.5
    drop = 1.0 - turbine["expansion_ratio"] ** (-287.05 / 1092.0)
    ideal_w = flow_kg_s * 1092.0 * turbine["t3_prime_k"] * drop
    # P4 and T3 are their readings here, which differ from 110 kPa and 500 degC by their errors: some tenths of a per cent.
    assert ((power_w / ideal_w / turbine["efficiency"] - 1.0).abs() < 0.02).all()
    assert (turbine["efficiency_low"] < turbine["efficiency"]).all()
    nodes = mapper.identify(run).turbine_map
    inside = nodes[~nodes["extrapolated"]]
    assert (inside["flow_low"] < inside["flow_parameter_kg_sqrt_k_s_kpa"]).all()


def test_the_map_is_that_of_the_command(run: mapper.Run, command: Callable[..., Any], tmp_path: Path) -> None:
    command("identify", run.directory, "--out", tmp_path / "out")
    compressor_map = mapper.identify(run).map
    assert compressor_map.to("csv") == (tmp_path / "out/map.csv").read_bytes()
    assert compressor_map.to("json") == run.map.to("json") == (tmp_path / "out/map.json").read_bytes()
    file = tmp_path / "map.m"
    assert compressor_map.to("simscape", file) == file.read_bytes()
    with pytest.raises(mapper.MapperError):
        compressor_map.to("simscape", file)
    with pytest.raises(mapper.MapperError):
        compressor_map.to("clay")
    assert set(mapper.map_formats().index) >= {"csv", "json", "sae", "simscape", "svg"}
    assert "<svg" in compressor_map._repr_html_()
    assert compressor_map.plot().collections


def test_the_surface_passes_through_its_nodes(run: mapper.Run) -> None:
    compressor_map = run.map
    fitted = compressor_map.fitted
    assert fitted is not None
    inner = fitted[(fitted["beta_ratio"] > 0.5) & (fitted["beta_ratio"] < 1.0)]
    at = {"speed_rpm": inner["line_speed_corrected_rpm"], "flow_kg_s": inner["flow_corrected_kg_s"]}
    # Interpolation at a node returns it but for rounding.
    np.testing.assert_allclose(compressor_map.eta(**at), inner["eta"], rtol=1e-9)
    np.testing.assert_allclose(compressor_map.pressure_ratio(**at), inner["pressure_ratio"], rtol=1e-9)
    assert np.isnan(compressor_map.eta(speed_rpm=1e6, flow_kg_s=0.1))


def test_a_map_file_is_read_and_fitted(run: mapper.Run, tmp_path: Path) -> None:
    run.map.to("csv", tmp_path / "map.csv")
    read = mapper.Map.read(tmp_path / "map.csv")
    assert len(read.points) == len(run.map.points)
    with pytest.raises(mapper.MapperError):
        read.eta(speed_rpm=1e5, flow_kg_s=0.1)
    assert read.fit().fitted is not None
    with pytest.raises(mapper.MapperError):
        mapper.Map.read(tmp_path / "none.csv")


def test_steady_points_are_reduced() -> None:
    measured = pd.DataFrame({"N [rpm]": [9e4], "m [kg/s]": [0.05], "P1 [kPa]": [100.0], "T1 [degC]": [24.85]})
    measured = measured.assign(**{"P2 [kPa]": 150.0, "T2 [degC]": 74.85})
    points = mapper.reduce(measured, reference="SAE").points
    assert points["pressure_ratio"].iloc[0] == pytest.approx(1.5)
    # T1 and P1 are those of SAE J1826 (298 K, 100 kPa): nothing is corrected.
    assert points["flow_corrected_kg_s"].iloc[0] == pytest.approx(0.05)
    # Apparent efficiency of air with a constant ratio of specific heats of 1.4; cp varies by 0.6 % over this rise.
    assert points["eta"].iloc[0] == pytest.approx(298 * (1.5 ** (0.4 / 1.4) - 1) / 50, rel=0.006)
    with pytest.raises(mapper.MapperError):
        mapper.reduce(measured.drop(columns="T1 [degC]"), reference="SAE")


def test_a_gap_is_diagnosed_as_by_the_command(command: Callable[..., Any], gap_rig: Path, gap_run: mapper.Run) -> None:
    campaign = mapper.Campaign.load(gap_rig)
    seen: list[str] = []
    diagnosis = mapper.diagnose(gap_run, campaign, progress=lambda event: seen.append(event["event"]))
    assert diagnosis.json == command("gap", "diagnose", gap_rig, gap_run.directory)
    assert diagnosis.verdict == diagnosis.json["verdict"]
    assert len(diagnosis.causes) == len(diagnosis.json["candidates"])
    assert "progress" in seen
    # Nothing was planted: the diagnosis names no cause, and the points stay as they are.
    result = mapper.identify(gap_run, campaign=campaign)
    corrected = diagnosis.corrected(result)
    assert corrected.json["correction"]["refused"] == {"reason": "no_cause"}
    assert corrected.json["points"] == result.json["points"]
