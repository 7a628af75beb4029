"""Drivers: where a controller's driver comes from, by its name or its file, and whether it is complete."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

from straw.model.errors import ModelError
from straw.model.plugged import module_of, said
from straw.rig.controller import Controller
from straw.rig.errors import RigError

GROUP = "straw.controllers"


def controller_names() -> tuple[str, ...]:
    """Names that ``make_controller`` knows: of the files in ``rig/controllers``, and of installed packages."""
    import straw.rig.controllers

    own = {module.name.replace("_", "-") for module in pkgutil.iter_modules(straw.rig.controllers.__path__)}
    return tuple(sorted(own | {entry.name for entry in metadata.entry_points(group=GROUP)}))


def make_controller(name: str, port: str, **settings: Any) -> Controller:
    """The controller called ``name`` on ``port``, not opened yet; settings as its class takes them.

    ``name`` is one of `controller_names`, or the file of a driver (``my_controller.py``).
    """
    try:
        return driver_of(name)(port, **settings)
    except TypeError as error:
        raise RigError(f"controller {name}: {error}; its docstring names the settings it takes") from None


def driver_of(name: str) -> Callable[..., Controller]:
    """The driver of a controller, by its name or file; RigError where there is none, or it is no driver."""
    if name.endswith(".py"):
        return driver_in(Path(name).resolve())
    if name not in controller_names():
        raise RigError(f"controller {name!r} is unknown; known: {', '.join(controller_names())}, or a file D.py")
    for entry in metadata.entry_points(group=GROUP):
        if entry.name == name:
            try:
                given = entry.load()
            except Exception as error:
                raise RigError(
                    f"controller {name} of an installed package: {said(error)}; repair the package"
                ) from None
            return checked_driver(getattr(given, "CONTROLLER", given), f"controller {name} = {entry.value}")
    own = importlib.import_module(f"straw.rig.controllers.{name.replace('-', '_')}")
    driver: Callable[..., Controller] = own.CONTROLLER
    return driver


def driver_in(path: Path) -> type[Controller]:
    """The driver that a file gives as CONTROLLER; RigError, one line, where it gives no usable one."""
    try:
        module = module_of(path, "controller")
    except ModelError as error:
        raise RigError(str(error)) from None
    return checked_driver(getattr(module, "CONTROLLER", None), str(path))


def checked_driver(driver: object, where: str) -> type[Controller]:
    """A driver's class, if it is complete; otherwise a RigError that names what is missing."""
    if not (isinstance(driver, type) and issubclass(driver, Controller)):
        raise RigError(f"{where}: CONTROLLER = {driver!r}; expected a class made of straw.Controller")
    if lacking := sorted(driver.__abstractmethods__):
        raise RigError(f"{where}: {driver.__name__} lacks {', '.join(lacking)}; see straw.Controller")
    if not isinstance(getattr(driver, "name", None), str):
        raise RigError(f"{where}: {driver.__name__} has no name; give it one, as recordings name it")
    return driver
