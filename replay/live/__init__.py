"""The page of a run while it goes on: a feed in the rig's process, model and page in a process of their own."""
