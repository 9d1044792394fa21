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
    from granpinn import laws as laws
    from granpinn.config import Config as Config
    from granpinn.data import read_flow as read_flow
    from granpinn.data import write_flow as write_flow
    from granpinn.filming import film as film
    from granpinn.identification.identified import Identification as Identification
    from granpinn.identification.identified import load as load
    from granpinn.identification.identify import identify as identify
    from granpinn.identification.identify import identify_many as identify_many
    from granpinn.identification.one_law import one_law as one_law
    from granpinn.importers import convert as convert
    from granpinn.importers import flow as flow
    from granpinn.importers import read as read
    from granpinn.inspection import inspect as inspect
    from granpinn.results import Result as Result
    from granpinn.simulation import simulate as simulate

# `python -m granpinn.VERB` finds the commands there. An editable installation has several paths.
__path__.append(str(Path(__file__).with_name("commands")))
__version__ = "0.2.0"
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

__all__ = sorted((*_HOMES, "laws", "__version__"))


def __getattr__(name: str) -> Any:
    if name == "laws":
        return import_module("granpinn.laws")
    if name not in _HOMES:
        raise AttributeError(f"module 'granpinn' has no attribute {name!r}; it has {__all__}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
