"""The page of a comparison: one offline HTML file."""
