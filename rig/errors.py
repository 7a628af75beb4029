"""The errors this package raises on purpose: one line that names the thing, the place and the cure."""


class RigError(Exception):
    """Bad input or a state from which the rig cannot continue; the message is one line, fit to show a user."""


class LinkLostError(RigError):
    """The link to an instrument is lost (unplugged, closed, refused) and must be opened again."""


class LimitError(RigError):
    """The request is not allowed; nothing was sent, and a repetition would be refused too."""


class NoAnswerError(RigError):
    """No complete answer in time: a slow instrument or a bad line, no refusal; a repetition may succeed."""
