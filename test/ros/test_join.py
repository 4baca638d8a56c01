# SPDX-License-Identifier: Apache-2.0
"""The join calls back for a stamp exactly when all of its parts are there, and its memory stays bounded."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.ros.join import ExactJoin

TOPICS = ("image", "lines", "vanishing_points")
MESSAGES = st.lists(st.tuples(st.sampled_from(TOPICS), st.integers(0, 12)), max_size=80)


@given(st.permutations([(topic, stamp) for stamp in range(4) for topic in TOPICS]))
def test_in_any_order_every_answer_holds_the_parts_of_one_stamp_in_the_order_of_topics(
    arrivals: list[tuple[str, int]],
) -> None:
    answers: list[tuple[tuple[str, int], ...]] = []
    join: ExactJoin[tuple[str, int]] = ExactJoin(TOPICS, lambda *parts: answers.append(parts))
    for topic, stamp in arrivals:
        join.add(topic, stamp, (topic, stamp))
    for parts in answers:
        assert tuple(topic for topic, _ in parts) == TOPICS
        assert len({stamp for _, stamp in parts}) == 1
    assert answers[-1][0][1] == 3, "the newest stamp is complete in the end, whatever came before it"


@given(MESSAGES, st.integers(1, 5))
def test_stamps_only_go_forwards_and_memory_is_bounded(arrivals: list[tuple[str, int]], memory: int) -> None:
    done: list[int] = []
    join: ExactJoin[int] = ExactJoin(TOPICS, lambda *parts: done.append(parts[0]), memory)
    for topic, stamp in arrivals:
        join.add(topic, stamp, stamp)
        assert len(join) <= memory
    assert done == sorted(set(done))


@given(st.lists(st.integers(0, 1000), unique=True, min_size=1, max_size=40).map(sorted))
def test_topics_that_come_one_after_the_other_lose_nothing(stamps: list[int]) -> None:
    done: list[int] = []
    join: ExactJoin[int] = ExactJoin(TOPICS, lambda *parts: done.append(parts[0]), memory=1)
    for stamp in stamps:
        for topic in TOPICS:
            join.add(topic, stamp, stamp)
    assert done == stamps
    assert (join.dropped, len(join)) == (0, 0)


def test_what_is_given_up_is_counted() -> None:
    join: ExactJoin[int] = ExactJoin(("a", "b"), lambda *_: None, memory=2)
    for stamp in (1, 2, 3):
        join.add("a", stamp, stamp)
    assert join.dropped == 1
    join.add("b", 3, 3)
    assert (join.dropped, len(join)) == (2, 0)


def test_after_a_reset_time_may_start_anew() -> None:
    done: list[int] = []
    join: ExactJoin[int] = ExactJoin(("a", "b"), lambda *parts: done.append(parts[0]))
    for stamp in (5, 1):
        join.add("a", stamp, stamp)
        join.add("b", stamp, stamp)
    assert done == [5]
    join.reset()
    join.add("a", 1, 1)
    join.add("b", 1, 1)
    assert done == [5, 1]


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="two or more"):
        ExactJoin(("a",), lambda *_: None)
    with pytest.raises(ValueError, match="two or more"):
        ExactJoin(("a", "a"), lambda *_: None)
    with pytest.raises(ValueError, match="at least 1"):
        ExactJoin(("a", "b"), lambda *_: None, memory=0)
    with pytest.raises(KeyError):
        ExactJoin(("a", "b"), lambda *_: None).add("c", 1, 1)


@given(
    st.lists(st.integers(0, 1000), unique=True, max_size=30).map(sorted), st.randoms(use_true_random=False)
)
def test_nothing_is_lost_while_topics_lag_less_than_the_memory(stamps: list[int], random: Random) -> None:
    """Each topic speaks in order, up to four stamps ahead of the slowest."""
    done: list[int] = []
    join: ExactJoin[int] = ExactJoin(TOPICS, lambda *parts: done.append(parts[0]), memory=5)
    spoken = dict.fromkeys(TOPICS, 0)
    while min(spoken.values()) < len(stamps):
        slowest = min(spoken.values())
        able = [topic for topic, count in spoken.items() if count < min(len(stamps), slowest + 5)]
        topic = random.choice(able)
        join.add(topic, stamps[spoken[topic]], stamps[spoken[topic]])
        spoken[topic] += 1
    assert done == stamps
    assert join.dropped == 0
