"""A system that a user writes as a Python file: a function, or slopes that are integrated."""
