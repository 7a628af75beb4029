"""The functions and classes of `import straw`: they take files or objects, and notebooks draw their results."""
