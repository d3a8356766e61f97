"""A nominal model and recordings as one question, with what noise is and what is known before."""
