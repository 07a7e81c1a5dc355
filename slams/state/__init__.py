"""States: an algorithm with its map in one file, to be resumed in another run.

    >>> from slams.state import load_state, save
    >>> save(slam, "floor.state")
    >>> slam = load_state("floor.state")

A resumed run gives the poses and maps of an uninterrupted one, bit for bit, on one machine and with
one release; other releases refuse the file. It contains numbers and arrays, no pickle and no code.
"""

from slams.state.store import State, load_state, read_state, save

__all__ = ["State", "load_state", "read_state", "save"]
