"""Diagnosis: where simulation and recordings differ, what the model leaves out, and how much better it fits with it."""
