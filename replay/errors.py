"""ReplayError, and the list of all errors that are a message to the user rather than a fault of the program."""

from __future__ import annotations

from straw.model.errors import ModelError
from straw.rig.errors import RigError
from straw.tracking.errors import TrackingError


class ReplayError(Exception):
    """Bad input to a comparison or a command; the message is one line, fit to show a user."""


#: All errors whose message is one line for the user rather than a fault of the program; catch these.
USER_ERRORS = (ModelError, TrackingError, RigError, ReplayError)
