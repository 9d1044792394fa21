"""The friction law and the pressure of a granular flow, identified from its velocity field.

    import granpinn

    flow = granpinn.read_flow("collapse.h5")
    result = granpinn.identify(flow, steps=6000)
    print(result)

Names are loaded when they are first used, so that `python -m granpinn.doctor` also runs where
torch or the compiled kernels cannot be imported.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granpinn import laws
    from granpinn.config import Config
    from granpinn.data import read_flow, write_flow
    from granpinn.filming import film
    from granpinn.identification.identified import Identification, load
    from granpinn.identification.identify import identify, identify_many
    from granpinn.identification.one_law import one_law
    from granpinn.importers import convert, flow, read
    from granpinn.inspection import inspect
    from granpinn.results import Result
    from granpinn.simulation import simulate

# `python -m granpinn.VERB` finds the commands there. An editable installation has several paths.
__path__.append(str(Path(__file__).with_name("commands")))
__version__ = "0.2.0"
__all__ = [
    "Config",
    "Identification",
    "Result",
    "__version__",
    "convert",
    "film",
    "flow",
    "identify",
    "identify_many",
    "inspect",
    "laws",
    "load",
    "one_law",
    "read",
    "read_flow",
    "simulate",
    "write_flow",
]

_HOMES = {
    "Config": "granpinn.config",
    "Identification": "granpinn.identification.identified",
    "Result": "granpinn.results",
    "convert": "granpinn.importers",
    "film": "granpinn.filming",
    "flow": "granpinn.importers",
    "identify": "granpinn.identification.identify",
    "identify_many": "granpinn.identification.identify",
    "inspect": "granpinn.inspection",
    "load": "granpinn.identification.identified",
    "one_law": "granpinn.identification.one_law",
    "read": "granpinn.importers",
    "read_flow": "granpinn.data",
    "simulate": "granpinn.simulation",
    "write_flow": "granpinn.data",
}


def __getattr__(name: str) -> Any:
    if name == "laws":
        return import_module("granpinn.laws")
    if name not in _HOMES:
        raise AttributeError(f"module 'granpinn' has no attribute {name!r}; it has {__all__}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
