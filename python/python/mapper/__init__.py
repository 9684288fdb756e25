"""Turbocharger compressor maps from the recordings of a gas stand.

All functions compute what the command ``mapper`` computes, with the same numbers. Values are in SI units, shaft speed in rpm; the name of a
column ends with its unit, and ``DataFrame.attrs["units"]`` lists all of them.

Examples
--------
>>> import mapper
>>> campaign = mapper.Campaign.load("turbo_a.yaml")
>>> run = campaign.run(progress=True)
>>> result = mapper.identify(run)
>>> result.points[["speed_rpm", "flow_kg_s", "eta", "eta_low", "eta_high"]]
>>> result.map.to("simscape", "map.m")
"""

from mapper._backend import Backend
from mapper._campaign import Campaign, Plan
from mapper._diagnosis import Diagnosis, diagnose
from mapper._effect import Effect, Parameter
from mapper._map import Map, map_formats, reduce
from mapper._mapper import CampaignError, IdentificationError, MapperError, RecordingError
from mapper._recording import Recording
from mapper._result import Result, identify
from mapper._run import Run

__all__ = [
    "Backend",
    "Campaign",
    "CampaignError",
    "Diagnosis",
    "Effect",
    "IdentificationError",
    "Map",
    "MapperError",
    "Parameter",
    "Plan",
    "Recording",
    "RecordingError",
    "Result",
    "Run",
    "diagnose",
    "identify",
    "map_formats",
    "reduce",
]
