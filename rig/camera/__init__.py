"""Cameras under remote control: started, stopped, and the film of a run fetched."""
