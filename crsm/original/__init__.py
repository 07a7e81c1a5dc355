"""The published program of [Tsardoulias13], crsm_slam of 2016, step by step."""

from crsm.original.params import OriginalParams
from crsm.original.slam import Original

__all__ = ["Original", "OriginalParams"]
