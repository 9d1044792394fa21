"""Friction laws side by side in one batch, and the fixed parameters of a law."""

from __future__ import annotations

import pytest

from granpinn.config import Config, ConfigError
from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.fit.case import fixed_values
from granpinn.identification.identify import identify, identify_many
from granpinn.physics.laws import LAWS

from ..runs import tiny


def test_members_of_one_batch_have_laws_of_their_own(flow: Flow) -> None:
    """Each member ends where it ends alone."""
    config = tiny()
    together = identify_many([flow] * len(LAWS), config, laws=list(LAWS))
    for name, found in zip(LAWS, together, strict=True):
        alone = identify(flow, tiny(law=name))
        assert found.law.name == name
        assert found.parameters.keys() == alone.parameters.keys()
        for parameter, value in found.parameters.items():
            assert value.value == pytest.approx(alone.parameters[parameter].value, rel=1e-6)
        assert found.residuals is not None
        assert alone.residuals is not None
        assert found.residuals.constitutive == pytest.approx(alone.residuals.constitutive, rel=1e-5)


def test_fixed_values_are_given_or_of_the_flow_or_usual(demo: Flow) -> None:
    facts = Facts(demo, scales_of(demo))
    fix = {"rheology__fix": ("mu_inf=0.02",)}
    found = fixed_values(Config(law="regularised", I0=0.2, **fix), facts)
    assert found == {"I0": 0.2, "mu_inf": 0.02, "alpha": 1.9, "I1": 0.004}
    assert fixed_values(Config(law="coulomb"), facts) == {}
    assert fixed_values(Config(), facts) == {"I0": 0.3}
    of_flow = fixed_values(Config(law="free"), facts)
    assert of_flow == fixed_values(Config(law="free", seed=5), facts)
    assert 0.001 < of_flow["I_low"] < 0.02 < 0.1 < of_flow["I_high"] < 0.5
    low = of_flow["I_low"]
    with pytest.raises(ConfigError, match=f"I_high must be above I_low = {low}, got 0.001"):
        fixed_values(Config(law="free", rheology__fix=("I_high=0.001",)), facts)
