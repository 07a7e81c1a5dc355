"""The published program of [Kohlbrecher11], hector_mapping."""

from hector.original.params import OriginalParams
from hector.original.slam import Original

__all__ = ["Original", "OriginalParams"]
