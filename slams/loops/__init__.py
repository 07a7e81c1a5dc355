"""Loop closure: a pose graph over keyframes for any algorithm that offers two hooks.

    >>> slam = slams.create("hector+loops")

`Looped` wraps an algorithm that is a `slams.localize.Localizes`. `PoseGraph` holds keyframes,
steps and loops. `LoopDetector` finds loops. `Redraw` builds a new map from corrected keyframes.
"""

from slams.loops.graph import LoopEdge, PoseGraph
from slams.loops.slam import Looped, looped

__all__ = ["LoopEdge", "Looped", "PoseGraph", "looped"]
