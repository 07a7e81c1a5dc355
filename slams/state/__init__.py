"""States: an algorithm with its map in one file, to go on from in another run.

    >>> from slams.state import load_state, save
    >>> save(slam, "floor.state")
    >>> slam = load_state("floor.state")

The poses and maps are those of a run that never stopped, bit for bit, on one machine and with one
release; other releases refuse the file. It holds numbers and arrays, no pickle and no code.
"""

from slams.state.store import State, load_state, read_state, save

__all__ = ["State", "load_state", "read_state", "save"]
