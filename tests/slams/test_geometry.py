import numpy as np
import pytest

from slams.geometry import inverse3, solve3


def test_solve3_solves_and_refuses_what_is_singular():
    rng, out = np.random.default_rng(0), np.zeros(3)
    A = rng.normal(size=(3, 3))
    H, b = A @ A.T + 0.1 * np.eye(3), rng.normal(size=3)
    assert solve3(H, b, out)
    assert out == pytest.approx(np.linalg.solve(H, b))
    for singular in (np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), np.ones((3, 3))):
        assert not solve3(singular, b, out)
    assert not solve3(np.full((3, 3), np.nan), b, out)


@pytest.mark.parametrize("seed", range(5))
def test_the_inverse_equals_numpys(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 1.0, (3, 3))
    A = root @ root.T + np.diag([0.1, 10.0, 1.0])
    assert inverse3(A) == pytest.approx(np.linalg.inv(A), rel=1e-9)
