"""The archive: run folders are the truth, a database is their index and can be made anew from them."""
