"""Minibatches: Philox4x32-10 by its published vectors, and the indices drawn with it."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
import torch
from scipy import stats

MASK = 0xFFFFFFFF


def philox4x32_10(counter: tuple[int, ...], key: tuple[int, ...]) -> tuple[int, ...]:
    """Written from the paper in Python's exact integers (Salmon et al., SC 2011)."""
    x0, x1, x2, x3 = counter
    k0, k1 = key
    for round_ in range(10):
        if round_:
            k0, k1 = (k0 + 0x9E3779B9) & MASK, (k1 + 0xBB67AE85) & MASK
        product_0, product_1 = 0xD2511F53 * x0, 0xCD9E8D57 * x2
        x0, x1, x2, x3 = (
            (product_1 >> 32) ^ x1 ^ k0,
            product_1 & MASK,
            (product_0 >> 32) ^ x3 ^ k1,
            product_0 & MASK,
        )
    return x0, x1, x2, x3


def expected_indices(seed: int, step: int, stream: int, count: int, population: int) -> list[int]:
    """Two 64-bit numbers a block, each scaled to [0, population) by the high half of a product."""
    seed, step = seed % 2**64, step % 2**64
    key = (seed & MASK, seed >> 32)
    indices = []
    for i in range(count):
        block = philox4x32_10((i // 2, step & MASK, step >> 32, stream), key)
        low, high = block[2 * (i % 2) : 2 * (i % 2) + 2]
        indices.append(((high << 32 | low) * population) >> 64)
    return indices


@pytest.mark.parametrize(
    ("counter", "key", "words"),
    [
        ("00000000 00000000 00000000 00000000", "00000000 00000000",
         "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff",
         "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0",
         "d16cfe09 94fdcceb 5001e420 24126ea1"),
    ],
    ids=["zeros", "ones", "pi"],
)  # fmt: skip
def test_published_vectors_of_the_generator(counter: str, key: str, words: str) -> None:
    """The known answers of Random123; they check the Python above, which checks the op below."""
    integers = [tuple(int(word, 16) for word in text.split()) for text in (counter, key, words)]
    assert philox4x32_10(integers[0], integers[1]) == integers[2]


def test_the_op_draws_the_published_numbers(ops: ModuleType) -> None:
    """With key and counter 0 the two indices are the high words e169c58d and 9b00dbd8, scaled."""
    population = 2**32 - 1
    high_words = [0xE169C58D, 0x9B00DBD8]
    got = ops.sample_indices(0, 0, 0, 2, population).tolist()
    assert got == expected_indices(0, 0, 0, 2, population)
    assert got == pytest.approx(high_words, abs=1)


@pytest.mark.parametrize(
    ("seed", "step", "stream", "population"),
    [
        (0, 0, 0, 10),
        (1, 2, 3, 117_000),
        (2**40 + 5, 2**35 + 7, 1, 66_000),
        (-1, 10**6, 2, 2**31 + 11),
        (7, 3, 0, 1),
        (2**63 - 1, 2**63 - 1, 2**32 - 1, 2**32 - 1),
    ],
)
def test_indices(seed: int, step: int, stream: int, population: int, ops: ModuleType) -> None:
    got = ops.sample_indices(seed, step, stream, 101, population)
    assert got.dtype == torch.int64
    assert got.tolist() == expected_indices(seed, step, stream, 101, population)


def test_a_pure_function_without_state(ops: ModuleType) -> None:
    first = ops.sample_indices(3, 5, 0, 64, 1000)
    for other in ((4, 5, 0), (3, 6, 0), (3, 5, 1)):
        assert not torch.equal(ops.sample_indices(*other, 64, 1000), first)
    assert torch.equal(ops.sample_indices(3, 5, 0, 64, 1000), first)
    assert torch.equal(ops.sample_indices(3, 5, 0, 16, 1000), first[:16])
    assert torch.equal(ops.sample_indices(3, torch.tensor(5), 0, 64, 1000), first)
    assert ops.sample_indices(3, 5, 0, 0, 1000).shape == (0,)


def test_uniform_and_uncorrelated(ops: ModuleType) -> None:
    """Chi-square of counts and of pairs of neighbours; a fixed seed, so no chance of a failure."""
    population = 64
    draws = torch.stack([ops.sample_indices(11, step, 0, 512, population) for step in range(200)])
    counts = np.bincount(draws.flatten().numpy(), minlength=population)
    assert 0.001 < stats.chisquare(counts).pvalue < 0.999
    for neighbours in (
        draws[:, ::2] * population + draws[:, 1::2],  # within a step
        draws[::2] * population + draws[1::2],
    ):  # from step to step
        counts = np.bincount(neighbours.flatten().numpy(), minlength=population**2)
        assert 0.001 < stats.chisquare(counts).pvalue < 0.999
