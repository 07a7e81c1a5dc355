"""Localization in a map that stays: found from nothing, then followed by any of the algorithms.

    >>> from slams.localize import Finder, open_map
    >>> finder = Finder(open_map("map.yaml").grid)

`Finder` finds the place of a robot; `prepare` gives an algorithm the map as its own; `Localizer`
runs it there. What an algorithm has to offer for that is `Localizes`.
"""

from slams.localize.finder import Finder
from slams.localize.hooks import Localizes
from slams.localize.localizer import Localizer
from slams.localize.search import Atlas, Candidate
from slams.localize.source import open_map, prepare

__all__ = ["Atlas", "Candidate", "Finder", "Localizer", "Localizes", "open_map", "prepare"]
