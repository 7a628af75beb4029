"""Constants of a straw from recordings, as `straw identify runs` fits them."""
