"""The one error this package raises on purpose: a single line that names the thing, the place and the cure."""


class TrackingError(Exception):
    """Bad input or a state from which tracking cannot continue; the message is one line, fit to show a user."""
