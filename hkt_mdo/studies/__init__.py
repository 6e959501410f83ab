"""What runs many cases: the paper, other flows and sensor noise."""
