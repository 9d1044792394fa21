"""Boxes in space and time."""

import torch

from granpinn.training.boxes import Boxes

COUNT = 4


def test_boxes_are_equal_and_hold_all_points() -> None:
    points = torch.rand(5000, 3, dtype=torch.float64) * torch.tensor([3.0, 1.0, 0.1])
    lower, upper = points.amin(0), points.amax(0)
    boxes = Boxes(lower, upper, COUNT)
    number = boxes.number(points)
    assert len(number.unique()) == boxes.total == COUNT**3
    for k in range(0, boxes.total, 7):
        inside = points[number == k]
        extent = (inside.amax(0) - inside.amin(0)) / (upper - lower)
        assert (extent <= 1 / COUNT + 1e-12).all()
    beyond = torch.stack([lower - 1, upper + 1])
    assert boxes.number(beyond).tolist() == [0, boxes.total - 1]
