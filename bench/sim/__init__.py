"""Make a log: arenas, drives, sensors, and what breaks an algorithm."""
