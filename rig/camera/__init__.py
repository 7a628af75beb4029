"""Cameras under remote control: start, stop, and fetch the video of a run."""
