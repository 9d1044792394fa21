"""Work of several flows side by side, in threads that an error or a signal does not wait for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TypeVar

# Threads that hold Python wait for each other, 5 ms at a time: 30 members took 31 s after their
# training with 16 threads, 20 s with 4 and 22 s with 2 (bench/studies/performance/note.md).
BESIDE = 4
S = TypeVar("S")
T = TypeVar("T")


@contextmanager
def threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of `count` threads; an error leaves the block at once and cancels their work.

    The executor's own context would wait for all work that has been submitted.
    """
    pool = ThreadPoolExecutor(count)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def beside_gpu(work: Callable[[S], T], items: Sequence[S], on_gpu: bool) -> list[T]:
    """`work` on every item: with a GPU side by side; on a CPU in turn, as torch uses all cores."""
    if len(items) == 1:
        return [work(items[0])]
    with threads(BESIDE if on_gpu else 1) as pool:
        begun = [pool.submit(work, item) for item in items]
        wait(begun)  # the error of one item leaves the others
        return [item.result() for item in begun]
