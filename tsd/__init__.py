"""TSD SLAM [May14]: one grid of truncated signed distances."""

from tsd.params import TsdParams
from tsd.slam import Tsd

__all__ = ["Tsd", "TsdParams"]
