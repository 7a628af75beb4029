"""Physics, one term a file: formula and source in the docstring, one compiled function that adds to the Load."""
