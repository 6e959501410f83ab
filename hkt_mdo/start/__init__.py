"""The start of an optimization: one search for it, of several strategies."""
