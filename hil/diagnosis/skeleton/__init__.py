"""What a nominal model leaves of the recordings that it was identified from, and whether later ones leave more."""
