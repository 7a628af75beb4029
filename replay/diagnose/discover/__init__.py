"""What no library holds: where something is missing, over what, and as which law, from the recordings alone."""
