"""Readers and writers of file formats: logs, bags, trajectories, maps."""
