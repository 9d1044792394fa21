"""The expected precision for every friction law."""

import pytest

from granpinn.data import Flow, add_noise
from granpinn.inspection import AssumedLaw, inspect
from granpinn.physics.laws import LAWS


@pytest.mark.usefixtures("no_balance")
def test_the_range_of_a_free_curve_follows_from_the_flow(demo: Flow, seed: int) -> None:
    noisy = add_noise(demo, 0.02, seed)
    found = inspect(noisy, AssumedLaw(law="free"))
    numbers = found["inertial_number"]
    assert found.law.I_low < numbers.q05 < numbers.q95 < found.law.I_high < numbers.q99
    assert "c1 to c8 to " in found.sentences[0]
    given = inspect(noisy, AssumedLaw(law="free", I_high=2.0))
    assert (given.law.I_low, given.law.I_high) == (found.law.I_low, 2.0)


@pytest.mark.usefixtures("no_balance")
@pytest.mark.parametrize("name", LAWS)
def test_the_precision_of_a_law(name: str, demo: Flow, seed: int) -> None:
    """Of all parameters that are identified but a cohesion; noise makes it worse."""
    found = inspect(add_noise(demo, 0.02, seed), AssumedLaw(law=name))
    record = found["precision"]
    assert set(record.expected) == set(LAWS[name].free) - {LAWS[name].cohesion}
    for free, sd in record.expected.items():
        assert 0 < record.without_noise[free] <= sd
    assert found.numbers()["law"]["name"] == name
    assert ("mu_2" in " ".join(found.lines())) == ("mu_2" in LAWS[name].names)


def test_a_range_upside_down_is_refused() -> None:
    with pytest.raises(ValueError, match="I_high must be above I_low = 0.3, got 0.1"):
        AssumedLaw(law="free", I_low=0.3, I_high=0.1)
