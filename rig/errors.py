"""The one kind of error this room raises on purpose: a single line that names the thing, the place and the cure."""


class RigError(Exception):
    """Bad input or a state from which the rig cannot continue; the message is one line, fit to show a user."""


class LinkLostError(RigError):
    """The way to an instrument is gone (unplugged, closed, refused): nothing more will come through it."""


class LimitError(RigError):
    """What was asked is not allowed; nothing was sent, and asking again changes nothing."""


class NoAnswerError(RigError):
    """Nothing came back in time, or nothing whole: a slow instrument or a bad line, no refusal; asking again helps."""
