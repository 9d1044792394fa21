"""From the frames of a film to a flow: `granpinn.film(...)` and `python -m granpinn.film`."""

from typing import Any

from granpinn.command.callable_module import call_like


def _film(*args: Any, **settings: Any) -> Any:
    from granpinn.film.measurement import film  # OpenCV is an extra

    return film(*args, **settings)


call_like(_film, __name__)
