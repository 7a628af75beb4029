"""The user's guide, and the reference of commands and of `import straw`, which is generated: see ``__main__``."""
