"""Discovery of laws beyond the library: where something is missing, over which state, and its form."""
