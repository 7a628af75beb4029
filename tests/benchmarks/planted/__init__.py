"""Laws planted in systems of other kinds than the measured ones: what the search finds of them."""
