"""Stages on threads: order, bounds, and every way to stop them."""

from __future__ import annotations

import contextlib
import random
import threading
import time
from collections.abc import Iterator

import pytest

from xcalib.stages import Stage, busy_shares, stream


@pytest.fixture(autouse=True)
def no_thread_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) == before


def unsteady(value: int) -> int:
    time.sleep(random.Random(value).random() / 500)
    return value


@pytest.mark.parametrize("overlapped", [True, False])
def test_results_come_in_order(overlapped: bool) -> None:
    stages = [Stage("a", unsteady, 4), Stage("b", lambda x: x + 1), Stage("c", unsteady, 3)]
    assert list(stream(range(60), stages, overlapped=overlapped)) == list(range(1, 61))


def test_a_stage_of_one_worker_sees_frames_in_order() -> None:
    seen: list[int] = []
    list(stream(range(60), [Stage("a", unsteady, 4), Stage("b", seen.append)]))
    assert seen == list(range(60))


def test_one_thread_does_one_thing_after_the_other() -> None:
    done: list[tuple[str, int]] = []
    stages = [Stage(name, lambda x, name=name: done.append((name, x)) or x, 3) for name in "ab"]
    list(stream(range(3), stages, overlapped=False))
    assert done == [(name, x) for x in range(3) for name in "ab"]


def test_frames_under_way_are_bounded() -> None:
    """However slow the last stage: what is taken but not yet given back stays below ``ahead``."""
    taken = 0

    def count() -> Iterator[int]:
        nonlocal taken
        for value in range(50):
            taken += 1
            yield value

    stages = [Stage("quick", lambda x: x, 2), Stage("slow", unsteady)]
    for index, _ in enumerate(stream(count(), stages, ahead=5)):
        assert taken - index <= 5


def test_stages_overlap() -> None:
    """Each stage waits for the other to have begun with another frame: alone it would wait on."""
    barrier = threading.Barrier(2, timeout=20)

    def meet(value: int) -> int:
        barrier.wait()
        return value

    def first(value: int) -> int:
        return value if value == 0 else meet(value)

    def second(value: int) -> int:
        return value if value == 9 else meet(value)

    assert list(stream(range(10), [Stage("a", first), Stage("b", second)])) == list(range(10))


@pytest.mark.parametrize("overlapped", [True, False])
@pytest.mark.parametrize("broken", range(4))
@pytest.mark.parametrize("error", [ValueError("frame 7"), KeyboardInterrupt(), MemoryError()])
def test_an_error_in_any_stage(broken: int, error: BaseException, overlapped: bool) -> None:
    written: list[int] = []

    def run(place: int, value: int) -> int:
        unsteady(value)
        if place == broken and value >= 7:
            raise error
        if place == 3:
            written.append(value)
        return value

    stages = [
        Stage(f"{place}", lambda x, place=place: run(place, x), 1 if place == 2 else 3)
        for place in range(4)
    ]
    given: list[int] = []
    with pytest.raises(type(error)) as caught:
        given.extend(stream(range(100), stages, overlapped=overlapped))
    assert caught.value is error
    assert given == list(range(7))
    assert sorted(written) == given  # all before it, and nothing after it


def test_the_earliest_frame_names_the_error() -> None:
    """Frame 1 fails at once, frame 0 late: one by one, frame 0 would have failed."""

    def fail(value: int) -> None:
        time.sleep(0.05 if value == 0 else 0)
        raise ValueError(f"frame {value}")

    with pytest.raises(ValueError, match="frame 0"):
        list(stream(range(10), [Stage("a", fail, 4)]))


def test_an_error_of_the_source_of_items() -> None:
    def items() -> Iterator[int]:
        yield from range(5)
        raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        list(stream(items(), [Stage("a", unsteady, 2)]))


def test_an_error_in_the_loop_over_it() -> None:
    started: list[int] = []

    def note(value: int) -> int:
        started.append(value)
        return unsteady(value)

    def loop() -> None:
        stages = [Stage("a", note, 2), Stage("b", unsteady)]
        with contextlib.closing(stream(range(1000), stages)) as results:
            for value in results:
                if value == 10:
                    raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        loop()
    assert len(started) < 30


def test_busy_shares_show_what_the_others_wait_for() -> None:
    stages = [
        Stage("decode", lambda x: x, 2),
        Stage("decode", lambda x: time.sleep(0.004)),
        Stage("encode", lambda x: time.sleep(0.002), 4),
    ]
    start = time.perf_counter()
    list(stream(range(30), stages))
    shares = busy_shares(stages, time.perf_counter() - start)
    assert list(shares) == ["decode", "encode"]
    assert 1 >= shares["decode"] > 2 * shares["encode"] > 0
