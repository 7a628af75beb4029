"""`import straw`: the public names in one place, each loaded when it is first used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from straw.model.direction import Direction
    from straw.model.errors import ModelError
    from straw.model.parameters import StrawParameters
    from straw.model.plugged import add_laws
    from straw.model.straw_file import load_straw
    from straw.model.term import Constant, Law
    from straw.replay.api.comparing import Comparison, Replay, replay
    from straw.replay.api.diagnosing import Diagnosis, diagnose
    from straw.replay.api.driving import controller, controllers, emulated, run_protocol
    from straw.replay.api.filming import Track, track
    from straw.replay.api.predicting import Derivatives, LongPrediction, Prediction, differentiate, simulate
    from straw.replay.api.recordings import Protocol, Recording, load_protocol, read_recording, write_recording
    from straw.replay.api.systems import SystemDiagnosis, diagnose_system
    from straw.replay.api.tables import Import, export_table, import_tables
    from straw.replay.compare.judge import Motion
    from straw.replay.errors import USER_ERRORS, ReplayError
    from straw.replay.metrics.merit import FigureOfMerit, add_figures
    from straw.rig.controller import Controller
    from straw.rig.errors import RigError
    from straw.rig.limits import PressureLimits
    from straw.rig.reading import Answer, Reading
    from straw.rig.run import Event, PressureLog
    from straw.rig.tables.reader import Reader, add_readers
    from straw.tracking.board import Board
    from straw.tracking.camera import Camera, load_camera
    from straw.tracking.errors import TrackingError
    from straw.tracking.trace import TipTrace

    __version__: str

__all__ = [
    "USER_ERRORS",
    "Answer",
    "Board",
    "Camera",
    "Comparison",
    "Constant",
    "Controller",
    "Derivatives",
    "Diagnosis",
    "Direction",
    "Event",
    "FigureOfMerit",
    "Import",
    "Law",
    "LongPrediction",
    "ModelError",
    "Motion",
    "Prediction",
    "PressureLimits",
    "PressureLog",
    "Protocol",
    "Reader",
    "Reading",
    "Recording",
    "Replay",
    "ReplayError",
    "RigError",
    "StrawParameters",
    "SystemDiagnosis",
    "TipTrace",
    "Track",
    "TrackingError",
    "__version__",
    "add_figures",
    "add_laws",
    "add_readers",
    "controller",
    "controllers",
    "diagnose",
    "diagnose_system",
    "differentiate",
    "emulated",
    "export_table",
    "import_tables",
    "load_camera",
    "load_protocol",
    "load_straw",
    "read_recording",
    "replay",
    "run_protocol",
    "simulate",
    "track",
    "write_recording",
]

#: The module of each public name. `replay` is the package, which can be called.
_PLACES = {
    "SystemDiagnosis": "straw.replay.api.systems",
    "diagnose_system": "straw.replay.api.systems",
    "Import": "straw.replay.api.tables",
    "export_table": "straw.replay.api.tables",
    "import_tables": "straw.replay.api.tables",
    "Motion": "straw.replay.compare.judge",
    "FigureOfMerit": "straw.replay.metrics.merit",
    "add_figures": "straw.replay.metrics.merit",
    "Reader": "straw.rig.tables.reader",
    "add_readers": "straw.rig.tables.reader",
    "Answer": "straw.rig.reading",
    "Reading": "straw.rig.reading",
    "add_laws": "straw.model.plugged",
    "Constant": "straw.model.term",
    "Law": "straw.model.term",
    "Board": "straw.tracking.board",
    "Camera": "straw.tracking.camera",
    "Comparison": "straw.replay.api.comparing",
    "Controller": "straw.rig.controller",
    "Derivatives": "straw.replay.api.predicting",
    "Diagnosis": "straw.replay.api.diagnosing",
    "Direction": "straw.model.direction",
    "Event": "straw.rig.run",
    "LongPrediction": "straw.replay.api.predicting",
    "ModelError": "straw.model.errors",
    "Prediction": "straw.replay.api.predicting",
    "PressureLimits": "straw.rig.limits",
    "PressureLog": "straw.rig.run",
    "Protocol": "straw.replay.api.recordings",
    "Recording": "straw.replay.api.recordings",
    "Replay": "straw.replay.api.comparing",
    "ReplayError": "straw.replay.errors",
    "RigError": "straw.rig.errors",
    "StrawParameters": "straw.model.parameters",
    "TipTrace": "straw.tracking.trace",
    "Track": "straw.replay.api.filming",
    "TrackingError": "straw.tracking.errors",
    "USER_ERRORS": "straw.replay.errors",
    "controller": "straw.replay.api.driving",
    "controllers": "straw.replay.api.driving",
    "diagnose": "straw.replay.api.diagnosing",
    "differentiate": "straw.replay.api.predicting",
    "emulated": "straw.replay.api.driving",
    "load_camera": "straw.tracking.camera",
    "load_protocol": "straw.replay.api.recordings",
    "load_straw": "straw.model.straw_file",
    "read_recording": "straw.replay.api.recordings",
    "run_protocol": "straw.replay.api.driving",
    "simulate": "straw.replay.api.predicting",
    "track": "straw.replay.api.filming",
    "write_recording": "straw.replay.api.recordings",
}
_ROOMS = ("model", "replay", "rig", "tracking")


def __getattr__(name: str) -> object:
    """Load a public name, or a package."""
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
