"""The start of an optimization: the optimum of the problem without time."""
