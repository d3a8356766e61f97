"""How the tables of the index came to be what they are; run by Alembic."""
