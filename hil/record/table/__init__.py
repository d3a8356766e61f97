"""From the columns of a file to a recording, whatever program wrote it."""
