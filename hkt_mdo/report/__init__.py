"""The report: one self-contained HTML page of one result or several, for people."""
