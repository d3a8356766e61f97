"""Run folders: appended to while a procedure runs, readable at any moment, whole after a kill."""
