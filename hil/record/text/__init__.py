"""Text files of any layout as columns."""
