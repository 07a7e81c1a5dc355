"""What a run says of itself against the truth: series made by hand, one scan every 0.1 s."""

import numpy as np

from bench.judge.loss import alarms, beyond
from bench.judge.metrics import Common

STEP = 0.1


def flags(n, *ranges):
    found = np.zeros(n, bool)
    for first, after in ranges:
        found[first:after] = True
    return found


def judged(says, off, n=200):
    return alarms(flags(n, *says), STEP * np.arange(n), flags(n, *off))


def test_a_run_that_never_left_the_limits():
    found = judged([], [])
    assert found == (0, 0, 200, 0, None)
    cried = judged([(10, 30)], [])
    assert (cried.right, cried.false) == (200, 20)
    assert cried.right_again is None


def test_a_loss_said_in_time_late_and_never():
    assert judged([(105, 150)], [(100, 150)]).in_time == 1
    assert judged([(112, 150)], [(100, 150)]).in_time == 0
    found = judged([(15, 20), (75, 80)], [(10, 20), (50, 80), (120, 140)])
    assert (found.episodes, found.in_time) == (3, 1)


def test_a_warning_right_before_a_loss_counts_as_said_and_is_not_false():
    found = judged([(95, 96)], [(100, 150)])
    assert (found.in_time, found.false) == (1, 0)
    assert found.right == 200 - 50 - 10
    early = judged([(80, 81)], [(100, 150)])
    assert (early.in_time, early.false) == (0, 1)


def test_an_alarm_after_the_way_back_is_false_and_no_answer():
    found = judged([(150, 170)], [(100, 150)])
    assert (found.in_time, found.false, found.right) == (0, 20, 140)


def test_short_looks_into_the_limits_do_not_end_an_episode():
    found = judged([], [(100, 110), (119, 130)])
    assert (found.episodes, found.right) == (1, 200 - 30 - 10)
    apart = judged([], [(100, 110), (121, 130)])
    assert apart.episodes == 2
    chain = judged([(128, 130)], [(100, 105), (110, 115), (120, 130)])
    assert (chain.episodes, chain.in_time) == (1, 0)


def test_right_again_is_the_last_second():
    assert judged([], [(100, 150)]).right_again is True
    assert judged([], [(100, 200)]).right_again is False
    assert judged([], [(100, 195)]).right_again is False
    assert judged([], [(100, 185)]).right_again is True


def test_a_clock_that_is_set_back_stands_still():
    t = STEP * np.concatenate([np.arange(100), 50 + np.arange(100)])
    found = alarms(flags(200, (152, 160)), t, flags(200, (140, 160)))
    assert found.episodes == found.in_time == 1  # the clock goes on from 9.9 s at scan 150


def test_limits_are_of_the_distance_and_the_turn_apart():
    truth = np.zeros((5, 3))
    estimate = truth.copy()
    estimate[1:, :] = [(0.4, 0.0, 0.0), (0.4, 0.4, 0.0), (0.0, 0.0, -0.31), (0.0, 0.0, 6.2)]
    common = Common(np.arange(5.0), estimate, truth, 0)
    assert beyond(common).tolist() == [False, False, True, True, False]
