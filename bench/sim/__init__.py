"""Simulate logs: arenas, drives, sensors, degradations."""
