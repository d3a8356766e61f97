"""What is said of a verdict, the corrected model, and the test that would tell most."""
