"""Parameters of the reading of a scan."""

from __future__ import annotations

from dataclasses import dataclass

from slams.params import Params, param


@dataclass(frozen=True)
class ScanParams(Params):
    """Which end points are used, and how noise and normals are measured."""

    min_range: float = param(
        0.1, "m", "nearer ends are not used", source="ours: the laser's own", low=0.0
    )
    max_range: float = param(
        80.0, "m", "farther ends are not used", source="ours: a SICK LMS", low=0.5
    )
    deskew: bool = param(
        True,
        "1",
        "correct the motion during a sweep that has a time per beam",
        source="ours: 3 cm at 0.5 m/s and 5 Hz",
        switch=True,
    )
    normal_window: float = param(
        0.05,
        "m",
        "half length of the piece of scan a normal is fitted to",
        source="ours: a cell",
        low=0.005,
    )
    range_noise: float = param(
        0.02,
        "m",
        "noise of a beam before the first estimate",
        source="ours: between a UTM-30LX's 0.01 and its specified 0.03",
        low=1e-4,
    )
    quietest: float = param(
        0.001, "m", "least noise that is assumed", source="ours: what ranges are rounded to"
    )
    noisiest: float = param(
        0.15, "m", "greatest noise that is assumed", source="ours: three cells; beyond is clutter"
    )
