"""The truth: finer physics than the library's, other laws, another solver. Nothing of `hil.physics` is used here."""
