"""A learned proposal: which causes to try for a campaign, in which order, and from which starts."""
