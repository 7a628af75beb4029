"""The interface to hardware: ports, controllers, emulators, recordings."""
