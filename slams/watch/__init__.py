"""Watching a run: films, the viewer rerun, and the scene both draw."""
