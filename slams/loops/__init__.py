"""Loop closure: a pose graph over keyframes around any algorithm that offers two hooks.

    >>> slam = slams.create("hector+loops")

`Looped` wraps the algorithm, a `slams.localize.Localizes`; `PoseGraph` holds keyframes, steps and
loops; `LoopDetector` finds loops; `Redraw` draws the map anew after a closure.
"""

from slams.loops.graph import LoopEdge, PoseGraph
from slams.loops.slam import Looped, looped

__all__ = ["LoopEdge", "Looped", "PoseGraph", "looped"]
