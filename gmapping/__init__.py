"""GMapping, grid mapping with a Rao-Blackwellized particle filter [Grisetti07]."""

from gmapping.params import GMappingParams
from gmapping.slam import GMapping

__all__ = ["GMapping", "GMappingParams"]
