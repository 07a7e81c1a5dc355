"""CRSM: critical rays matched to one global map by random restart hill climbing."""

from crsm.params import CrsmParams
from crsm.slam import Crsm

__all__ = ["Crsm", "CrsmParams"]
