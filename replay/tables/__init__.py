"""Options, texts and the picture of straw import and straw export."""
