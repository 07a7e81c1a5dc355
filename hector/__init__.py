"""Hector SLAM [Kohlbrecher11]: gradient map matching on a grid pyramid."""

from hector.params import HectorParams
from hector.slam import Hector

__all__ = ["Hector", "HectorParams"]
