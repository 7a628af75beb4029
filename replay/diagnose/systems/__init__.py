"""Systems that can be diagnosed, a folder each."""
