"""Systems that can be diagnosed, a room each."""
