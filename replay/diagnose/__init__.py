"""Diagnosis: where simulation and recordings differ, what was left out, and how much better it fits with it."""
