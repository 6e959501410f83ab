"""Running a case: passes, checks, summary, check, batch."""
