"""What is known of an estimate: noise, fit, evidence for a form, what samples tell of values together."""
