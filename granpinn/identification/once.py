"""Values that are made once, also between threads."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class Once(Generic[K, V]):
    """A function that makes its value for each argument once; a value that fails is tried again.

    Threads that ask meanwhile wait.
    """

    def __init__(self, make: Callable[[K], V]) -> None:
        self._make, self._lock = make, Lock()
        self._made: dict[K, V] = {}

    def __call__(self, key: K) -> V:
        with self._lock:
            if key not in self._made:
                self._made[key] = self._make(key)
            return self._made[key]
