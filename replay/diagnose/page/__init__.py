"""The page of a diagnosis: from the verdict down to the evidence, read in two minutes."""
