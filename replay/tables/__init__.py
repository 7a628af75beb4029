"""What straw import and straw export show and are told: flags, words, the picture of a plan."""
