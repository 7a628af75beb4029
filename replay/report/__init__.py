"""The page people look at: one offline HTML file."""
