"""The rig's film: taken during a run, tracked into a file, checked against the model, and set on the run's clock."""
