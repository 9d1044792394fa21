"""The friction law and the pressure of a granular flow, identified from its velocity field.

    import granpinn

    flow = granpinn.read_flow("collapse.h5")
    result = granpinn.identify(flow, granpinn.Config())

Names are loaded when they are first used, so that `python -m granpinn.doctor` also runs where
torch or the compiled kernels cannot be imported.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granpinn.config import Config
    from granpinn.data import read_flow, write_flow
    from granpinn.identification.batch import identify_many
    from granpinn.identification.identified import Identification, load
    from granpinn.identification.single import identify
    from granpinn.importers import flow
    from granpinn.kernels.swish_network import SwishNetwork
    from granpinn.results import Result
    from granpinn.simulation import simulate

__version__ = "0.2.0"
__all__ = [
    "Config",
    "Identification",
    "Result",
    "SwishNetwork",
    "__version__",
    "flow",
    "identify",
    "identify_many",
    "load",
    "read_flow",
    "simulate",
    "write_flow",
]

_HOMES = {
    "Config": "granpinn.config",
    "Identification": "granpinn.identification.identified",
    "Result": "granpinn.results",
    "SwishNetwork": "granpinn.kernels.swish_network",
    "flow": "granpinn.importers",
    "identify": "granpinn.identification.single",
    "identify_many": "granpinn.identification.batch",
    "load": "granpinn.identification.identified",
    "read_flow": "granpinn.data",
    "simulate": "granpinn.simulation",
    "write_flow": "granpinn.data",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'granpinn' has no attribute {name!r}; it has {__all__}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
