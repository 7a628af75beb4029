"""The one kind of error this room raises on purpose: a single line that names the thing, the place and the cure."""


class ModelError(Exception):
    """Bad input or a state the model room cannot go on from; the message is one line, fit to show a user."""
