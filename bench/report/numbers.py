"""Figures as text: how many digits a column shows, by its unit."""

from __future__ import annotations

from typing import Any

DECIMALS = {
    "after [m]": 1,
    "[m]": 4,
    "[rad]": 4,
    "walls [mm]": 0,
    "[mm]": 2,
    "[mrad]": 3,
    "[ms]": 3,
    "[MB]": 0,
    "[s]": 1,
    "[%]": 2,
    "real time": 0,
    "walls [x]": 3,
}
MAP_SHARES = ("IoU",)
FIVE = ("mean", "deviation", "min", "max")


def cell(column: str, value: Any) -> str:
    """A value as its column shows it; nothing as a dash."""
    if value is None or value != value:
        return "-"
    if isinstance(value, str):
        return value
    if column in FIVE:
        return f"{value:.5f}"
    if column in MAP_SHARES:
        return f"{value:.3f}"
    if float(value).is_integer() and "[" not in column:
        return f"{value:.0f}"
    places = next((d for unit, d in DECIMALS.items() if unit in column), 2)
    return f"{value:.{places}f}"
