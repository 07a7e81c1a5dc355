"""States: an algorithm's map and all it knows in one file, to go on from in another run.

    >>> from slams.state import load_state, save
    >>> save(slam, "floor.state")
    >>> slam = load_state("floor.state")

Going on gives the poses and maps of never having stopped, bit for bit, on one machine and with one
release. There is no pickle and no code in the file.
"""

from slams.state.store import State, load_state, read_state, save

__all__ = ["State", "load_state", "read_state", "save"]
