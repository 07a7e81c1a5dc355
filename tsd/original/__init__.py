"""The published program of [May14] and [Koch15], ohm_tsd_slam."""

from tsd.original.params import OriginalParams
from tsd.original.slam import Original

__all__ = ["Original", "OriginalParams"]
