"""The published program of [Grisetti07], gmapping of OpenSLAM behind slam_gmapping."""

from gmapping.original.params import OriginalParams
from gmapping.original.slam import Original

__all__ = ["Original", "OriginalParams"]
