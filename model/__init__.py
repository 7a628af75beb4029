"""What a straw should do: the equations of motion, terms, rest states, simulation."""
