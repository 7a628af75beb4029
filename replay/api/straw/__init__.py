"""`import straw`: the public names in one place, each loaded when it is first asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from straw.model.parameters import StrawParameters, load_straw
    from straw.model.simulate import Prediction, simulate
    from straw.rig.protocol import PressureProtocol
    from straw.rig.protocol_toml import load_protocol
    from straw.rig.run_read import read_run

    __version__: str

__all__ = [
    "Prediction",
    "PressureProtocol",
    "StrawParameters",
    "__version__",
    "load_protocol",
    "load_straw",
    "read_run",
    "simulate",
]

#: Where each public name lives.
_PLACES = {
    "Prediction": "straw.model.simulate",
    "PressureProtocol": "straw.rig.protocol",
    "StrawParameters": "straw.model.parameters",
    "load_protocol": "straw.rig.protocol_toml",
    "load_straw": "straw.model.parameters",
    "read_run": "straw.rig.run_read",
    "simulate": "straw.model.simulate",
}
_ROOMS = ("model", "replay", "rig", "tracking")


def __getattr__(name: str) -> object:
    """Load a public name, or a room."""
    if name in _PLACES:
        value: object = getattr(import_module(_PLACES[name]), name)
    elif name in _ROOMS:
        value = import_module(f"straw.{name}")
    elif name == "__version__":
        value = import_module("importlib.metadata").version("straw")
    else:
        raise AttributeError(f"module 'straw' has no attribute {name!r}; see straw.__all__")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, whether loaded or not."""
    return sorted({*__all__, *_ROOMS})
