"""Cameras that can be told: start, stop, and the film of a run fetched."""
