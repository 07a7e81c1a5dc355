"""How often a search that finds nothing is repeated."""

import numpy as np
import pytest

from slams.frontend.backoff import Backoff


def tries(backoff, seconds, dt):
    """The times [s] of the tries, all of them failed."""
    at = []
    for k in range(round(seconds / dt)):
        backoff.wait(dt)
        if backoff.over:
            backoff.tried()
            at.append(dt * k)
    return at


def test_pauses_double_up_to_the_longest():
    gaps = np.diff(tries(Backoff(0.1, 1.0), 10.0, 0.01))
    assert gaps == pytest.approx([0.1, 0.2, 0.4, 0.8] + [1.0] * (len(gaps) - 4), abs=0.011)


@pytest.mark.parametrize("rate", [5, 40])
def test_failed_tries_are_so_many_a_minute_whatever_the_rate_of_scans(rate):
    assert len(tries(Backoff(0.06, 2.0), 60.0, 1.0 / rate)) == pytest.approx(34, abs=3)


def test_after_a_success_the_first_try_is_at_once_and_its_pause_the_shortest():
    backoff = Backoff(0.1, 1.0)
    assert backoff.over
    for _ in range(3):
        backoff.tried()
    backoff.forget()
    assert backoff.over
    backoff.tried()
    backoff.wait(0.09)
    assert not backoff.over
    backoff.wait(0.02)
    assert backoff.over
