"""The front end, the same for every algorithm: motion filter, degeneracy, decision, recovery."""
