"""RigFile: the set-up as a TOML file: controller and channels, limits, camera, LED, straw, folder."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.limits import STRAW_LIMITS, PressureLimits
from straw.rig.protocol_toml import UNITS_PA
from straw.rig.toml_place import At

NAME = "rig.toml"
TOP_KEYS = ("name", "folder", "straw", "rate_hz", "led", "controller", "limits", "camera")
CAMERAS = ("gopro", "by hand")


@dataclass(frozen=True)
class CameraFile:
    """The camera: ``gopro`` is controlled over HTTP at ``address``, ``by hand`` by a person; ``lens``: CAMERA.json."""

    kind: str = "by hand"
    address: str = ""
    lens: Path | None = None


@dataclass(frozen=True)
class RigFile:
    """A rig as described by its file. ``port`` empty: an emulator takes the controller's place. Paths are absolute."""

    path: Path
    name: str
    folder: Path
    controller: str
    port: str
    channels: tuple[int, ...] = (1,)
    settings: dict[str, Any] = field(default_factory=dict)
    limits: PressureLimits = STRAW_LIMITS
    straw: Path | None = None
    rate_hz: float = 100.0
    led: bool = False
    camera: CameraFile | None = None

    @property
    def emulated(self) -> bool:
        """Whether the rig is emulated."""
        return not self.port


def load_rig(path: str | Path) -> RigFile:
    """Read a rig file; RigError with one line naming file, section, entry and cure."""
    path = Path(path)
    at = At(path.name)
    try:
        document = tomllib.loads(path.read_bytes().decode())
    except OSError as error:
        raise RigError(f"rig file {path} cannot be read: {error.strerror or error}; check the name") from None
    except UnicodeDecodeError:
        raise RigError(f"rig file {path} is not a text file; it is TOML, see the README") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        at.fail(f"not valid TOML: {error}")
    at.known_keys(document, TOP_KEYS)
    if "controller" not in document:
        at.fail('[controller] is missing; add name = "ob1-mk4" and port = "/dev/...", or emulate = true')
    here = path.resolve().parent
    name, port, channels, settings = _controller(at.inside("[controller]"), _table(at, document, "controller"))
    straw = document.get("straw")
    return RigFile(
        path=path.resolve(),
        name=at.string(document.get("name", path.stem), "name"),
        folder=(here / at.string(document.get("folder", "."), "folder")).resolve(),
        controller=name,
        port=port,
        channels=channels,
        settings=settings,
        limits=_limits(at.inside("[limits]"), _table(at, document, "limits")),
        straw=_existing(at, here, straw, "straw") if straw is not None else None,
        rate_hz=at.positive(document.get("rate_hz", 100.0), "rate_hz"),
        led=_flag(at, document.get("led", False), "led"),
        camera=_camera(at.inside("[camera]"), _table(at, document, "camera"), here) if "camera" in document else None,
    )


def _controller(at: At, table: dict[str, Any]) -> tuple[str, str, tuple[int, ...], dict[str, Any]]:
    at.known_keys(table, ("name", "port", "emulate", "channels", "settings"))
    port, emulate = at.string(table.get("port", ""), "port"), _flag(at, table.get("emulate", False), "emulate")
    if bool(port) == emulate:
        at.fail('write either port = "/dev/serial/by-id/..." or emulate = true')
    channels = table.get("channels", [1])
    if not isinstance(channels, list) or not channels:
        at.fail("channels must list the channels in use, as [1] or [1, 2]")
    numbers = tuple(at.integer(channel, "a channel", 1) for channel in channels)
    if len(set(numbers)) != len(numbers):
        at.fail(f"channels = {channels} names a channel twice")
    settings = _table(at, table, "settings")
    return at.string(table.get("name", "ob1-mk4"), "name"), port, numbers, {k: _tuples(v) for k, v in settings.items()}


def _limits(at: At, table: dict[str, Any]) -> PressureLimits:
    at.known_keys(table, ("pressure_unit", "min", "max", "max_rate"))
    unit = table.get("pressure_unit", "kPa")
    if unit not in UNITS_PA:
        at.fail(f"pressure_unit = {unit!r} is unknown; use one of {', '.join(UNITS_PA)}")
    given = {k: at.number(v, k) * UNITS_PA[unit] for k, v in table.items() if k != "pressure_unit"}
    try:
        low, high = given.get("min", STRAW_LIMITS.min_pa), given.get("max", STRAW_LIMITS.max_pa)
        return PressureLimits(low, high, given.get("max_rate"))
    except RigError as error:
        at.fail(str(error))


def _camera(at: At, table: dict[str, Any], here: Path) -> CameraFile:
    at.known_keys(table, ("kind", "address", "lens"))
    kind = at.string(table.get("kind", "by hand"), "kind")
    if kind not in CAMERAS:
        at.fail(f"kind = {kind!r} is unknown; use one of {', '.join(CAMERAS)}")
    address = at.string(table.get("address", ""), "address")
    if kind == "gopro" and not address.startswith("http://"):
        at.fail(
            'address is missing; a GoPro on USB is at "http://172.2X.1YZ.51:8080", XYZ its serial number\'s last digits'
        )
    lens = table.get("lens")
    return CameraFile(kind, address, _existing(at, here, lens, "lens") if lens is not None else None)


def _table(at: At, document: dict[str, Any], key: str) -> dict[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        at.fail(f"{key} must be a table: [{key}]")
    return table


def _existing(at: At, here: Path, value: object, what: str) -> Path:
    path = here / at.string(value, what)
    if not path.is_file():
        at.fail(f"{what} = {value!r} is not a file in {here}; correct the name, or leave it out")
    return path.resolve()


def _flag(at: At, value: object, what: str) -> bool:
    if not isinstance(value, bool):
        at.fail(f"{what} = {value!r} must be true or false")
    return value


def _tuples(value: Any) -> Any:
    """Drivers take tuples where TOML has lists."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
