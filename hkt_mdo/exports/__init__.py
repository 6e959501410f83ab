"""Exports: a result in the files that other programs read, one module a format."""
