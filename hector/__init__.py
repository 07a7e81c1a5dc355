"""Hector SLAM [Kohlbrecher11]."""
