"""Broken input files, by kind: each is refused by one message."""
