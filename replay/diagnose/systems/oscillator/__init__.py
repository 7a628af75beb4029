"""A driven oscillator of one degree of freedom as a system of the diagnosis."""
