"""How often a search that finds nothing is repeated."""

import numpy as np
import pytest

from slams.patience import Patience


def tries(patience, seconds, dt, quiet=False):
    """The times [s] of the tries, all in vain."""
    at = []
    for k in range(round(seconds / dt)):
        patience.wait(dt, quiet)
        if patience.over:
            patience.tried()
            at.append(dt * k)
    return at


def test_patience_doubles_until_scans_are_quiet():
    patience = Patience(0.1, 1.0)
    gaps = np.diff(tries(patience, 10.0, 0.1))
    assert gaps[0] == pytest.approx(0.1, abs=0.11)
    assert gaps[-1] == pytest.approx(1.0, abs=0.11)
    assert (np.diff(gaps) > -1e-9).all()
    for _ in range(60):
        patience.wait(0.1, quiet=True)
    patience.tried()
    patience.wait(0.15)
    assert patience.over


@pytest.mark.parametrize("rate", [5, 40])
def test_tries_in_vain_are_so_many_a_minute_whatever_the_rate_of_scans(rate):
    assert len(tries(Patience(0.06, 2.0), 60.0, 1.0 / rate)) == pytest.approx(34, abs=3)


def test_the_first_try_is_at_once_and_so_is_the_first_after_a_success():
    patience = Patience(0.5, 0.5)
    assert patience.over
    patience.tried()
    assert not patience.over
    patience.forget()
    assert patience.over
    patience.tried()
    patience.wait(0.45)
    assert not patience.over
    patience.wait(0.1)
    assert patience.over


def test_a_try_that_goes_on_makes_no_pause_longer():
    patience = Patience(0.5, 8.0)
    patience.again(0.1)
    assert not patience.over
    patience.wait(0.11)
    assert patience.over
    patience.tried()
    patience.wait(0.49)
    assert not patience.over
    patience.wait(0.02)
    assert patience.over


def test_after_a_success_the_first_pause_is_the_shortest_again():
    patience = Patience(0.1, 1.0)
    for _ in range(3):
        patience.tried()
    patience.forget()
    assert patience.over
    patience.tried()
    patience.wait(0.11)
    assert patience.over


def test_quiet_scans_shorten_the_pause_that_is_left_as_much_as_the_next():
    patience = Patience(0.5, 2.0)
    for _ in range(3):
        patience.tried()  # 2 s
    patience.wait(0.2, quiet=True)
    shorter = 2.0 * np.exp(-0.1)
    left = 2.0 - 0.2 - (2.0 - shorter)
    patience.wait(left - 1e-6)
    assert not patience.over
    patience.wait(2e-6)
    assert patience.over
    patience.tried()
    patience.wait(2.0 - 1e-6)
    assert not patience.over
