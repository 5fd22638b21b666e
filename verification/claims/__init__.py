"""The figures of the documentation, each with the command that measures it."""
