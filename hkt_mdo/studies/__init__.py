"""What runs many cases: the paper, verification, uncertainty."""
