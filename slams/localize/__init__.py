"""Localization in a map that stays: found from nothing, then followed by any of the algorithms.

    >>> from slams.localize import GlobalLocalizer, open_map
    >>> localizer = GlobalLocalizer(open_map("map.yaml").grid)

`GlobalLocalizer` finds the pose of a robot; `prepare` gives an algorithm the map as its own;
`Localizer` runs it there. What an algorithm has to offer for that is `Localizes`.
"""

from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.hooks import Localizes
from slams.localize.localizer import Localizer
from slams.localize.map_index import Candidate, MapIndex
from slams.localize.source import open_map, prepare

__all__ = [
    "Candidate", "GlobalLocalizer", "Localizer", "Localizes", "MapIndex", "open_map", "prepare",
]  # fmt: skip
