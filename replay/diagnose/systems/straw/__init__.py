"""The straw as a system of the diagnosis."""
