"""Running a case: passes, judges, summary, check, batch."""
