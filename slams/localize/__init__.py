"""Localization in a given map: global localization, then tracking by any of the algorithms.

    >>> from slams.localize import GlobalLocalizer, open_map
    >>> localizer = GlobalLocalizer(open_map("map.yaml").grid)

`GlobalLocalizer` finds the pose of a robot in a map, `prepare` converts the map for an algorithm,
and `Localizer` runs the algorithm in this map. Its class has to implement `Localizes`.
"""

from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.hooks import Localizes
from slams.localize.localizer import Localizer
from slams.localize.map_index import Candidate, MapIndex
from slams.localize.source import open_map, prepare

__all__ = [
    "Candidate", "GlobalLocalizer", "Localizer", "Localizes", "MapIndex", "open_map", "prepare",
]  # fmt: skip
