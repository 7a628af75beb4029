"""The page of a diagnosis: a story read in two minutes, from the verdict down to the evidence."""
