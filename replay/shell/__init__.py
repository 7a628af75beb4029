"""Finite elements beside the reduced energy: the table and the pictures."""
