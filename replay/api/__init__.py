"""What `import straw` gives: what the commands call, on files or objects, with results that show themselves."""
