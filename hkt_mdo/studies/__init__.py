"""Studies of many cases: the paper, other flows and sensor noise."""
