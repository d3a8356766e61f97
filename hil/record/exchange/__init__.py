"""File formats, one file each; `hil.record.read` picks one by the file's name."""
