"""Touches the world: ports, controllers, emulators, files."""
