"""Steps and drifts among numbers of many nights: found in their night, and nothing else."""

import math

import numpy as np
import pytest

from actin_xcheck.nightly.changes import FALSE_ALARM, changes, events
from actin_xcheck.nightly.differences import Shape
from actin_xcheck.nightly.history import Series
from actin_xcheck.nightly.record import NumberKind
from tests.histories import NIGHTS, ROUND_OFF, history, later, night, noise, series

# changes of one sequence


def test_noise_alone_is_reported_no_more_often_than_stated():
    random = np.random.default_rng(1)
    looks = 2000
    found = [one for _ in range(looks) for one in changes(noise(random), ROUND_OFF)]
    steps = sum(one.shape is not Shape.SUSPECT for one in found)
    # three standard deviations of a count above what is stated
    most = FALSE_ALARM * looks + 3 * math.sqrt(FALSE_ALARM * looks)
    assert steps <= most
    assert len(found) - steps <= 2 * most


@pytest.mark.parametrize(
    ("first", "size", "sigma", "found_at_least", "right_at_least"),
    [
        (45, math.log(1.2), 0.1, 0.88, 0.5),  # 6.2 standard errors; the night itself is not to be had surely
        (37, -0.2, 0.02, 0.98, 0.99),
        (37, -0.2, 0.05, 0.95, 0.9),
        (58, math.log(2.0), 0.05, 0.95, 0.99),  # three nights ago
    ],
)
def test_steps_are_found_and_their_nights_covered(first, size, sigma, found_at_least, right_at_least):
    random = np.random.default_rng(2)
    looks = 200
    found = [changes(noise(random, sigma) + size * later(first), ROUND_OFF) for _ in range(looks)]
    alone = [one[0] for one in found if len(one) == 1 and one[0].shape is Shape.STEP]
    assert len(alone) >= found_at_least * looks
    assert np.mean([one.first == first - 1 for one in alone]) >= right_at_least
    assert np.mean([one.within[0] <= first - 1 <= one.within[1] for one in alone]) >= 0.93
    errors = np.array([(one.size - size) / one.error for one in alone])
    assert abs(np.mean(errors)) < 0.5
    assert np.std(errors) < 1.5


def test_there_and_back_are_two_steps():
    random = np.random.default_rng(3)
    y = noise(random) + 0.5 * (later(21) - later(41))
    assert [(one.first, one.size > 0) for one in changes(y, ROUND_OFF)] == [(20, True), (40, False)]


def test_one_outlier_is_no_step_and_hides_none():
    random = np.random.default_rng(4)
    for _ in range(50):
        y = noise(random)
        y[random.integers(0, NIGHTS - 3)] += 1.5
        assert changes(y, ROUND_OFF) == []
    y = noise(random, 0.03) + 0.2 * later(30)
    y[[10, 50]] += 1.5
    (step,) = changes(y, ROUND_OFF)
    assert step.first == 29


@pytest.mark.parametrize("rate", [-0.02, 0.02])
def test_a_creeping_number_is_a_drift_from_its_night_on(rate):
    random = np.random.default_rng(5)
    found = [changes(noise(random, 0.05) + rate * np.cumsum(later(31)), ROUND_OFF) for _ in range(100)]
    drifts = [one[0] for one in found if len(one) == 1 and one[0].shape is Shape.DRIFT]
    assert len(drifts) >= 95
    assert np.mean([one.within[0] <= 30 <= one.within[1] for one in drifts]) >= 0.9
    assert np.mean([one.size for one in drifts]) == pytest.approx(30 * rate, rel=0.05)


def test_the_newest_night_is_a_suspect_and_three_make_a_step():
    random = np.random.default_rng(6)
    y = noise(random, 0.05) + later(58)
    kinds = [[(one.shape, one.first) for one in changes(y[:count], ROUND_OFF)] for count in range(57, 61)]
    suspect, step = (Shape.SUSPECT, 57), (Shape.STEP, 57)
    assert kinds == [[], [suspect], [suspect], [step]]


def test_a_persistent_noise_is_held_to_more():
    random = np.random.default_rng(7)
    found = 0
    for _ in range(500):
        y = noise(random)
        for i in range(1, NIGHTS):
            y[i] = 0.3 * y[i - 1] + math.sqrt(1 - 0.3**2) * y[i]
        found += bool(changes(y, ROUND_OFF))
    assert found <= 15  # 3 %


def test_without_noise_any_change_is_certain_at_once():
    y = np.full(NIGHTS, -3.0)
    assert changes(y, ROUND_OFF) == []
    assert changes(y + 1e-12 * np.arange(NIGHTS) / NIGHTS, ROUND_OFF) == []
    y[36:] += 1e-7
    y[59] += 1.0
    first, last = changes(y, ROUND_OFF)
    assert (first.first, last.first) == (36, 59)
    assert first.exact
    assert first.size == pytest.approx(1e-7)


def test_short_sequences_are_judged_or_left_alone():
    random = np.random.default_rng(8)
    for count in 50 * list(range(1, 12)):
        changes(noise(random, count=count), ROUND_OFF)  # warnings are errors
        changes(random.choice([1.0, 1.0, 1.0, 2.0], count), ROUND_OFF)


# events of many series


def test_the_synthetic_history_over_many_seeds():
    looks = 100
    both = covered = other = 0
    for seed in range(looks):
        found = events(history(seed, 6))
        order = [event for event in found if event.key == "order/dropped" and event.night == night(37)]
        time = [event for event in found if event.key == "time/slower" and event.shape is Shape.STEP]
        both += bool(order and time)
        covered += bool(time) and night(45) in time[0].within
        other += len(found) - len(order) - len(time)
        assert {event.direction for event in order + time} <= {"worse"}
    assert both >= 0.88 * looks
    # what is stated, and three standard deviations of the count
    assert other <= 0.02 * looks + 3 * math.sqrt(0.02 * looks)
    assert covered >= 0.95 * both - 3 * math.sqrt(0.95 * 0.05 * both)


def commits(number: int, every: int) -> str:
    """The commit of a night, where every so many nights bring one, nights 37 and 45 among them."""
    since = 37 if number < 45 else 45
    return f"{since}.{(number - since) // every}" if every > 1 else f"{number}"


def shared(seed: int, slow: int, busy: float = 0.0, every: int = 1, missing: float = 0.0) -> list[Series]:
    """Twenty times with 10 % noise, of which the first `slow` lose a fifth in night 45.

    Of the noise a part of `busy` is common to all in a night; each number lacks nights by chance.
    """
    random = np.random.default_rng(seed)
    common = noise(random, busy)
    found = []
    for number in range(20):
        own = noise(random, math.sqrt(0.1**2 - busy**2))
        values = np.exp(common + own) * (1.2 ** later(45) if number < slow else 1.0)
        has = np.flatnonzero(random.random(NIGHTS) >= missing)
        nights = tuple(night(int(at) + 1, commit=commits(int(at) + 1, every)) for at in has)
        found.append(Series(f"time/{number}", NumberKind.TIME, "s", nights, values[has]))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slow", "busy", "every", "missing", "right_at_least", "nights_at_most"),
    [
        (1, 0.0, 1, 0.0, 0.45, 8.0),  # all that one such number can say
        (1, 0.0, 3, 0.0, 0.7, 8.0),
        (3, 0.0, 1, 0.0, 0.8, 2.5),
        (6, 0.0, 1, 0.0, 0.95, 1.5),
        (6, 0.0, 3, 0.0, 0.98, 1.5),
        (6, 0.0, 1, 0.3, 0.75, 2.5),
        (6, 0.07, 1, 0.0, 0.6, 4.5),  # they err together, and do not count as six
        (20, 0.07, 1, 0.0, 0.65, 4.5),
    ],
)
def test_what_several_numbers_show_has_its_night(slow, busy, every, missing, right_at_least, nights_at_most):
    looks = 60
    right, held, widths = [], [], []
    for seed in range(looks):
        steps = [one for one in events(shared(seed, slow, busy, every, missing)) if one.shape is Shape.STEP]
        told = [one for one in steps if int(one.key[5:]) < slow]
        if not told:
            continue
        first = max(told, key=lambda one: one.together)
        right.append(first.night.name == night(45).name)
        held.append(night(45).name in [one.name for one in first.within])
        widths.append(len(first.within))
    assert len(right) >= (0.85 if slow == 1 else 1.0) * looks
    assert np.mean(right) >= right_at_least
    assert np.mean(held) >= 0.95 - 3 * math.sqrt(0.95 * 0.05 / len(held))
    assert np.mean(widths) <= nights_at_most


def test_numbers_that_always_say_the_same_count_as_one():
    random = np.random.default_rng(14)
    values = np.exp(noise(random)) * 1.25 ** later(45)
    (alone,) = events([series("time/0", NumberKind.TIME, values)])
    copies = events([series(f"time/{number}", NumberKind.TIME, values) for number in range(8)])
    assert {one.together for one in copies} == {8}
    assert {(one.night.name, len(one.within)) for one in copies} == {(alone.night.name, len(alone.within))}


def test_steps_that_lie_apart_or_go_apart_share_no_night():
    wanted = {"a1": (20, 1.5), "a2": (20, 1.5), "b1": (45, 1.5), "b2": (45, 1.5), "up": (45, 1 / 1.5)}
    for seed in range(40):
        random = np.random.default_rng(seed)
        found = events(
            series(name, NumberKind.TIME, np.exp(noise(random)) * size ** later(at))
            for name, (at, size) in wanted.items()
        )
        steps = {one.key: one for one in found if one.shape is Shape.STEP}
        assert [steps[name].together for name in wanted] == [2, 2, 2, 2, 1]
        assert steps["a1"].within[-1].name < steps["b1"].within[0].name


def test_a_step_without_noise_among_noise_is_no_part_of_a_noisy_cause():
    random = np.random.default_rng(0)
    sure = np.concatenate([np.full(10, 1.0), np.full(10, 2.0), 2 * np.exp(noise(random)[20:])])
    slow = [np.exp(noise(random)) * 1.5 ** later(11) for _ in range(3)]
    found = events([series(f"time/{i}", NumberKind.TIME, y) for i, y in enumerate([sure, *slow])])
    assert all(not one.exact for one in found if one.key != "time/0")


@pytest.mark.slow
def test_causes_some_nights_apart_are_told_apart_more_often_than_not():
    """Five numbers step at night 40, a sixth at night 45, which its interval holds in 43 of 59 histories."""
    held, where = [], night(45).name
    for seed in range(60):
        random = np.random.default_rng(seed)
        found = events(
            series(f"time/{i}", NumberKind.TIME, np.exp(noise(random)) * 1.2 ** later(45 if i == 5 else 40))
            for i in range(6)
        )
        ours = [one for one in found if one.key == "time/5" and one.shape is Shape.STEP]
        held += [where in [night.name for night in one.within] for one in ours[:1]]
    assert len(held) > 40
    assert np.mean(held) > 0.6


def test_a_change_is_put_to_the_night_with_anything_new():
    nights = tuple(night(i + 1, commit="new" if i >= 44 else "old") for i in range(NIGHTS))
    right = guessed = 0
    for seed in range(60):
        y = 3 * np.exp(noise(np.random.default_rng(seed))) * 1.3 ** later(45)
        (event,) = events([Series("time/a", NumberKind.TIME, "s", nights, y)])
        right += event.news == ("commit old -> new",) and event.night == nights[44]
        guessed += changes(np.log(y), ROUND_OFF)[0].first == 44
    assert right >= 57
    assert guessed < right  # what the numbers alone would say


def test_times_of_another_machine_are_no_slowdown_and_errors_are():
    random = np.random.default_rng(12)
    nights = tuple(night(i + 1, machine="a" if i < 30 else "b") for i in range(NIGHTS))
    values = np.exp(noise(random)) * 3.0 ** later(31)
    found = events(
        [Series(f"{kind}/x", kind, "", nights, values) for kind in (NumberKind.TIME, NumberKind.ERROR)]
    )
    assert [(event.key, event.night) for event in found] == [("error/x", nights[30])]
    assert "machine a -> b" in found[0].news


def test_small_changes_are_left_out_where_noisy_and_minor_where_exact():
    random = np.random.default_rng(13)
    small = 1.05 ** later(31)
    noisy = series("time/noisy", NumberKind.TIME, np.exp(noise(random, 0.01)) * small)
    exact, gross = (
        series(f"error/{i}", NumberKind.ERROR, y) for i, y in enumerate((small, 8.0 ** later(20)))
    )
    found = events([noisy, exact, gross])
    assert [(event.key, event.minor) for event in found] == [("error/1", False), ("error/0", True)]
    assert found[0].change == "1 -> 8 (x 8)"


def test_a_number_that_cannot_be_had_any_more_is_lost():
    values = np.where(later(50), math.nan, 1.0)
    never = series("error/never", NumberKind.ERROR, [math.nan] * 9)
    (event,) = events([series("error/a", NumberKind.ERROR, values), never])
    assert (event.shape, event.night) == (Shape.LOST, night(50))
