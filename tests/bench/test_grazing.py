"""A beam that grazes a face tells nothing of its pose."""

import math

import numpy as np

from bench.judge.bound_kernels import Squares, fisher_information


def test_a_beam_along_a_face_does_not_count():
    squares = Squares(np.ones((1, 1), bool), 1.0, 5.0, 0.0)
    for x, phi, r, counts in ((5.0, 0.5 * math.pi, 3.5, 0), (4.5, 0.0, 0.5, 1)):
        y = -3.0 if r > 1.0 else 0.5
        rays = np.array([[[x, y, phi]]])
        out, beams = np.zeros((1, 3, 3)), np.zeros(1, np.int64)
        one = np.ones((1, 1))
        base, nothing = np.array([[x, y, 0.0]]), np.zeros((1, 3, 3))
        fisher_information(squares, rays, r * one, one, base, nothing, out, beams)
        assert beams[0] == counts and out[0, 0, 0] == counts
