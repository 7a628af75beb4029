"""Judges: reality against prediction."""
