"""The page of a run in progress: a feed in the rig's process, model and page in a process of their own."""
