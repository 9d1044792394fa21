"""Values that are made once, also between threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest

from granpinn.identification.once import Once


def test_threads_get_one_value_for_each_argument() -> None:
    asked, together = [], Barrier(4)

    def make(key: str) -> list[str]:
        asked.append(key)
        return [key]

    once = Once(make)

    def of(key: str) -> list[str]:
        together.wait(60)
        return once(key)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(of, ["a", "b", "a", "b"]))
    assert sorted(asked) == ["a", "b"]
    assert found[0] is found[2]
    assert found[1] is found[3]


def test_a_value_that_fails_is_tried_again() -> None:
    left = [ValueError("no"), None]

    def make(_: int) -> int:
        error = left.pop(0)
        if error is not None:
            raise error
        return 7

    once = Once(make)
    with pytest.raises(ValueError, match="no"):
        once(0)
    assert once(0) == once(0) == 7
