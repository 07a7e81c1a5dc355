"""Judge a run: pure functions on arrays and plain values; nothing is run, drawn or written."""
