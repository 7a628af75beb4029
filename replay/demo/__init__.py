"""The demo's parts: what its simulated straw conceals, its runs, their video."""
