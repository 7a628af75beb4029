"""The one kind of error this room raises on purpose: a single line that names the thing, the place and the cure."""


class TrackingError(Exception):
    """Bad input or a state the tracking room cannot go on from; the message is one line, fit to show a user."""
