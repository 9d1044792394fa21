"""The equations of all splits of the data together (`parts.py`).

All splits share one pass over the points with the slopes by all unknowns, and one cheap pass for
the boxes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.training.boxes import Boxes
from granpinn.training.elimination import factor, gram
from granpinn.training.last_layer_sums import Sums, Unknowns
from granpinn.training.rows import Row
from granpinn.training.splits import Halves

SHARED, OWN = 2, 3  # fields with one last layer (u, v), and with one for each half (p, s_1, s_2)


class Columns(NamedTuple):
    """Derivatives of a row [n, k] by some of the unknowns, and the places of these [k]."""

    J: Tensor
    places: Tensor


class System:
    """The normal equations of all splits together.

    The K unknowns: C [5, F]; for every split with a step, the difference of C between the halves
    for p, s_1, s_2 [3, F]; the free parameters of the law [L]; for every split, their difference
    between the halves [L].
    """

    def __init__(self, sums: Sums, at: Unknowns, splits: list[Halves]) -> None:
        self.sums, self.at, self.splits = sums, at, splits
        F, L = at.C.shape[1], len(sums.free)
        self.F, self.L = F, L
        stepped = [k for k, halves in enumerate(splits) if halves.step is not None]
        self.place = {k: (SHARED + OWN + OWN * n) * F for n, k in enumerate(stepped)}
        self.n_C = (SHARED + OWN * (1 + len(stepped))) * F
        K = self.n_C + L * (1 + len(splits))
        self.A, self.b = at.C.new_zeros(K, K), at.C.new_zeros(K)
        self.points = torch.cat([sums.data.points, sums.data.surface_points])
        self.steps = {k: self._step(k, self.points) for k in stepped}
        self.second = torch.stack([halves.second.double() for halves in splits], 1)

    def _step(self, k: int, points: Tensor) -> Tensor:
        step = self.splits[k].step
        assert step is not None
        return step.jet(points)

    def _share(self, k: int, row: Row) -> Tensor:
        """The share of the second half in a row, with its slopes [3, n]."""
        return self.steps[k][:, row.points]

    def add_equations(self) -> None:
        """Add the sums over all points."""
        _, slope, h_h = self.sums.misfit(self.at)
        for u in range(SHARED):
            own = slice(u * self.F, (u + 1) * self.F)
            self.A[own, own] += self.sums.velocity_weight * h_h
            self.b[own] += slope[u]
        for row in self.sums.rows(self.at):
            plain = {c: torch.einsum("cn,cnf->nf", row.by_z[..., c], row.h) for c in row.used}
            common = self._common(row, plain)
            self._add(common, row.residual)
            # No split has unknowns of another one, so their products are not needed.
            for k in self.place if max(row.used) >= SHARED else ():
                of_split = self._own(k, row, plain)
                self._add(of_split, row.residual)
                both = of_split.J.T @ common.J
                self.A[of_split.places[:, None], common.places] += both
                self.A[common.places[:, None], of_split.places] += both.T

    def _add(self, columns: Columns, residual: Tensor) -> None:
        """Add the sums of some unknowns with each other."""
        J, i = columns
        self.A[i[:, None], i] += gram(J)
        self.b[i] += J.T @ residual

    def _common(self, row: Row, plain: Mapping[int, Tensor]) -> Columns:
        """The derivatives by C and by the laws; `plain` are those by C, for each field [n, F]."""
        every = torch.arange(len(self.b), device=self.b.device)
        parts = list(plain.values())
        places = [every[c * self.F : (c + 1) * self.F] for c in plain]
        if len(row.h) > 1:
            parts += [row.by_theta, self._by_halves(row)]
            places.append(every[self.n_C :])
        return Columns(torch.cat(parts, 1), torch.cat(places))

    def _own(self, k: int, row: Row, plain: Mapping[int, Tensor]) -> Columns:
        """The derivatives by the difference of C between the halves of split k."""
        every = torch.arange(len(self.b), device=self.b.device)
        parts, places = [], []
        share = self._share(k, row)
        for c in (c for c in row.used if c >= SHARED):
            own = share[0, :, None] * plain[c]
            if len(row.h) > 1:
                slope = (share[1:] * row.by_z[1:3, :, c]).sum(0)
                own = own + slope[:, None] * row.h[0]
            parts.append(own)
            start = self.place[k] + (c - SHARED) * self.F
            places.append(every[start : start + self.F])
        return Columns(torch.cat(parts, 1), torch.cat(places))

    def _by_halves(self, row: Row) -> Tensor:
        """Derivatives by the differences of the law [n, S L]."""
        return (self.second[row.points][:, :, None] * row.by_theta[:, None]).flatten(1)

    def _places(self, k: int) -> Tensor:
        """The places of the unknowns of one split: C first, then the law."""
        every = torch.arange(len(self.b), device=self.b.device)
        F, L, law = self.F, self.L, every[self.n_C :]
        own = [every[self.place[k] : self.place[k] + OWN * F]] if k in self.place else []
        return torch.cat([every[: 5 * F], *own, law[:L], law[L * (1 + k) : L * (2 + k)]])

    def solve(self, k: int) -> tuple[Tensor, Tensor] | None:
        """The unknowns x of a split, and the rows Q of the inverse for the law on both halves."""
        i = self._places(k)
        A, b, L = self.A[i[:, None], i], self.b[i], self.L
        self._expect_smooth(A, b)
        found = factor(A, 2 * L)
        if found is None:
            return None
        sides = self.A.new_zeros(len(i), 1 + 2 * L)
        sides[:, 0] = -b
        one = torch.eye(L, dtype=sides.dtype, device=sides.device)
        sides[-2 * L :, 1:] = torch.cat([one.repeat(1, 2), torch.cat([0 * one, one], 1)])
        x = torch.cholesky_solve(sides / found.scale[:, None], found.factor) / found.scale[:, None]
        return (x[:, 0], x[:, 1:]) if bool(x.isfinite().all()) else None

    def find_roughness(self) -> None:
        """The strength of the prior of a curve from all data, as in the last-layer step."""
        if not len(self.sums.differences):
            return
        i = torch.cat([torch.arange(5 * self.F), self.n_C + torch.arange(self.L)]).to(self.b.device)
        self.sums.expect_smooth(self.A[i[:, None], i], self.b[i], self.at)

    def _expect_smooth(self, A: Tensor, b: Tensor) -> None:
        """Add the prior of a curve, for the law of each half, to the equations of a split."""
        if not len(self.sums.differences):
            return
        D, L = self.sums.differences, self.L
        square = self.sums.roughness * D.T @ D
        slope = square @ self.at.theta[self.sums.free]
        both = torch.cat([torch.cat([2 * square, square], 1), torch.cat([square, square], 1)])
        A[-2 * L :, -2 * L :] += both
        b[-2 * L :] += torch.cat([2 * slope, slope])

    def influence(
        self,
        kept: list[int],
        solutions: list[tuple[Tensor, Tensor]],
        boxes: list[Boxes],
    ) -> list[tuple[Tensor, ...]]:
        """What every box adds to the error of the laws, by splits and sizes of boxes."""
        m = 2 * self.L
        sums = [[self.A.new_zeros(b.total, m) for b in boxes] for _ in kept]
        every = [torch.cat([x[:, None], Q], 1) for x, Q in solutions]

        def numbers(points: Tensor) -> list[Tensor]:
            return [of.number(points) for of in boxes]

        def add(n: int, places: list[Tensor], added: Tensor) -> None:
            for total, place in zip(sums[n], places, strict=True):
                total.index_add_(0, place, added)

        everywhere = numbers(self.points)
        with torch.enable_grad():
            for row in self.sums.rows(self.at):
                places = [number[row.points] for number in everywhere]
                for n, (k, X) in enumerate(zip(kept, every, strict=True)):
                    moved = self._along(row, k, X)
                    r = row.residual + moved[:, 0]
                    add(n, places, moved[:, 1:] * r[:, None])
        self._add_vectors(every, numbers, add)
        return [
            tuple(total[total.abs().sum(1) > 0].view(-1, 2, self.L) for total in own)
            for own in sums
        ]

    def _add_vectors(
        self,
        every: list[Tensor],
        numbers: Callable[[Tensor], list[Tensor]],
        add: Callable[[int, list[Tensor], Tensor], None],
    ) -> None:
        """The part of the measured velocity in `influence`; its `numbers` and `add`."""
        points = self.sums.data.measured[0]
        for rows, h, residual, w in self.sums.vectors(self.at):
            places = numbers(points[rows])
            for n, X in enumerate(every):
                by_C = X[: SHARED * self.F].view(SHARED, self.F, -1)
                moved = torch.einsum("nf,cfm->ncm", h, by_C)
                r = w * (residual + moved[..., 0])
                add(n, places, (r[..., None] * moved[..., 1:]).sum(1))

    def _along(self, row: Row, k: int, X: Tensor) -> Tensor:
        """The change of a row along directions X [K_k, m] of the unknowns of a split: [n, m]."""
        F, L = self.F, self.L
        total = row.h.new_zeros(row.h.shape[1], X.shape[1])
        for c in row.used:
            by_z = row.by_z[..., c, None]
            total += (by_z * (row.h @ X[c * F : (c + 1) * F])).sum(0)
            if c >= SHARED and k in self.place:
                share = self._share(k, row)[..., None]
                start = 5 * F + (c - SHARED) * F
                own = row.h @ X[start : start + F]
                total += share[0] * (by_z * own).sum(0)
                if len(row.h) > 1:
                    total += (share[1:] * by_z[1:3]).sum(0) * own[0]
        if len(row.h) > 1:
            total += row.by_theta @ X[-2 * L : -L]
            second = self.second[row.points][:, k, None]
            total += second * (row.by_theta @ X[-L:])
        return total
